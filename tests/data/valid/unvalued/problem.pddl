(define (problem bridge)
  (:domain unvalued)
  (:init (here))
  (:goal (there)))
