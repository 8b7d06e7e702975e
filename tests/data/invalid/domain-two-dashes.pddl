(define (domain broken)
  (:types cup bowl -- thing))
