(define (domain broken)
  (:types -cup))
