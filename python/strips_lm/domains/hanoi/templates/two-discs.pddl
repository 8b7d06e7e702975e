; Moves a tower of two discs to another peg.
(define (template two-discs)
  (:domain hanoi)
  (:parameters ?a - peg ?b - peg ?c - peg ?d1 - disc ?d2 - disc)
  (:init
    (fits ?d1 ?a) (fits ?d1 ?b) (fits ?d1 ?c) (fits ?d2 ?a) (fits ?d2 ?b) (fits ?d2 ?c)
    (fits ?d1 ?d2)
    (on ?d1 ?d2) (on ?d2 ?a) (clear ?d1) (clear ?b) (clear ?c))
  (:goal (and (on ?d1 ?d2) (on ?d2 ?b))))
