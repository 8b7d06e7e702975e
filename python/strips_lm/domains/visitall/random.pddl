; A square of cells with further ones hung on to it.
(define (template random)
  (:domain visitall)
  (:parameters ?a - cell ?b - cell ?c - cell ?d - cell)
  (:distractors 0 4
    (?e - cell
      (oneof (and (connected ?e ?a) (connected ?a ?e))
             (and (connected ?e ?b) (connected ?b ?e))
             (and (connected ?e ?c) (connected ?c ?e) (connected ?e ?d) (connected ?d ?e)))))
  (:init
    (connected ?a ?b) (connected ?b ?a) (connected ?b ?c) (connected ?c ?b)
    (connected ?c ?d) (connected ?d ?c) (connected ?d ?a) (connected ?a ?d)
    (walker-at ?a) (visited ?a)))
