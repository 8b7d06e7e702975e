(define (domain broken)
  (:types a b)
  (:constants c - a c - b))
