; A cell with three neighbours, all of which are to be visited.
(define (template star)
  (:domain visitall)
  (:parameters ?hub - cell ?a - cell ?b - cell ?c - cell)
  (:distractors 0 2
    (?e - cell (connected ?e ?hub) (connected ?hub ?e)))
  (:init
    (connected ?hub ?a) (connected ?a ?hub) (connected ?hub ?b) (connected ?b ?hub)
    (connected ?hub ?c) (connected ?c ?hub)
    (oneof (and (walker-at ?hub) (visited ?hub)) (and (walker-at ?a) (visited ?a))))
  (:goal (and (visited ?a) (visited ?b) (visited ?c))))
