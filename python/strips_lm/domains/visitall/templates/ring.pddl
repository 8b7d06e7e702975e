; Cells in a ring of four, two or three of which are to be visited.
(define (template ring)
  (:domain visitall)
  (:parameters ?a - cell ?b - cell ?c - cell ?d - cell)
  (:distractors 0 2
    (?e - cell
      (oneof (and (connected ?e ?a) (connected ?a ?e))
             (and (connected ?e ?c) (connected ?c ?e)))))
  (:init
    (connected ?a ?b) (connected ?b ?a) (connected ?b ?c) (connected ?c ?b)
    (connected ?c ?d) (connected ?d ?c) (connected ?d ?a) (connected ?a ?d)
    (walker-at ?a) (visited ?a) (oneof (visited ?b) (and)))
  (:goal (and (visited ?b) (visited ?c) (visited ?d))))
