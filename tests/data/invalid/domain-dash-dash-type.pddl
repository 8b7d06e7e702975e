(define (domain broken)
  (:types cup - -thing))
