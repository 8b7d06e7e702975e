(define (domain))
