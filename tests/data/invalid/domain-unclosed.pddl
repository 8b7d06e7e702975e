(define (domain broken)
  (:predicates (p)
