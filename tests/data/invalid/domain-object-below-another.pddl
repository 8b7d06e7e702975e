(define (domain broken)
  (:types vehicle object - thing))
