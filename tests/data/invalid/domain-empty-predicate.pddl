(define (domain broken) (:predicates ()))
