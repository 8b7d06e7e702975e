; Gathers three discs, spread over the pegs, to a tower.
(define (template gather)
  (:domain hanoi)
  (:parameters ?a - peg ?b - peg ?c - peg ?d1 - disc ?d2 - disc ?d3 - disc)
  (:init
    (fits ?d1 ?a) (fits ?d1 ?b) (fits ?d1 ?c) (fits ?d2 ?a) (fits ?d2 ?b) (fits ?d2 ?c)
    (fits ?d3 ?a) (fits ?d3 ?b) (fits ?d3 ?c) (fits ?d1 ?d2) (fits ?d1 ?d3) (fits ?d2 ?d3)
    (oneof (and (on ?d1 ?a) (on ?d2 ?b) (on ?d3 ?c) (clear ?d1) (clear ?d2) (clear ?d3))
           (and (on ?d1 ?d3) (on ?d3 ?a) (on ?d2 ?b) (clear ?d1) (clear ?d2) (clear ?c))
           (and (on ?d1 ?d2) (on ?d2 ?a) (on ?d3 ?b) (clear ?d1) (clear ?d3) (clear ?c))))
  (:goal (and (on ?d1 ?d2) (on ?d2 ?d3))))
