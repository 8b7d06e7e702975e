(define (domain broken)
  (:predicates (p) (q) (r))
  (:derived (p) (q))
  (:derived (q) (not (p))))
