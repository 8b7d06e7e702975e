; Four cells in a row; the walker begins at one of them.
(define (template path)
  (:domain visitall)
  (:parameters ?a - cell ?b - cell ?c - cell ?d - cell)
  (:init
    (connected ?a ?b) (connected ?b ?a) (connected ?b ?c) (connected ?c ?b) (connected ?c ?d) (connected ?d ?c)
    (oneof (and (walker-at ?a) (visited ?a)) (and (walker-at ?b) (visited ?b))))
  (:goal (and (visited ?a) (visited ?b) (visited ?c) (visited ?d))))
