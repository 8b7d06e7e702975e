(define (domain broken)
  (:predicates (p) (q) (P ?x)))
