; A grid of cells.
(define (template large)
  (:domain visitall)
  (:array cell (8 8)
    (neighbours ?a ?b (connected ?a ?b) (connected ?b ?a))
    (first ?a (walker-at ?a) (visited ?a))))
