(define (problem broken) (:domain blocks) (:goal (and)))
