; Bares the largest disc of a tower of three.
(define (template free-the-largest)
  (:domain hanoi)
  (:parameters ?a - peg ?b - peg ?c - peg ?d1 - disc ?d2 - disc ?d3 - disc)
  (:init
    (fits ?d1 ?a) (fits ?d1 ?b) (fits ?d1 ?c) (fits ?d2 ?a) (fits ?d2 ?b) (fits ?d2 ?c)
    (fits ?d3 ?a) (fits ?d3 ?b) (fits ?d3 ?c) (fits ?d1 ?d2) (fits ?d1 ?d3) (fits ?d2 ?d3)
    (on ?d1 ?d2) (on ?d2 ?d3) (on ?d3 ?a) (clear ?d1) (clear ?b) (clear ?c))
  (:goal (clear ?d3)))
