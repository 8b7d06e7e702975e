; Two cells of a two by three grid are to be visited.
(define (template reach)
  (:domain visitall)
  (:parameters ?a - cell ?b - cell ?c - cell ?d - cell ?e - cell ?f - cell)
  (:init
    (connected ?a ?b) (connected ?b ?a) (connected ?b ?c) (connected ?c ?b)
    (connected ?d ?e) (connected ?e ?d) (connected ?e ?f) (connected ?f ?e)
    (connected ?a ?d) (connected ?d ?a) (connected ?b ?e) (connected ?e ?b) (connected ?c ?f) (connected ?f ?c)
    (oneof (and (walker-at ?a) (visited ?a)) (and (walker-at ?b) (visited ?b)) (and (walker-at ?d) (visited ?d))))
  (:goal (and (visited ?c) (visited ?f))))
