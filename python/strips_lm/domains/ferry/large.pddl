; Many cars on many shores.
(define (template large)
  (:domain ferry)
  (:parameters ?home - shore)
  (:array shore (5))
  (:array car (20) (each ?c (at ?c (any shore))))
  (:init (empty) (ferry-at ?home)))
