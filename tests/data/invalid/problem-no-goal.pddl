(define (problem broken) (:domain blocks) (:init))
