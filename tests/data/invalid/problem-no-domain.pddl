(define (problem broken) (:init) (:goal (and)))
