; Somebody drives the truck to bring ?x to another place.
(define (template deliver)
  (:domain driverlog)
  (:parameters ?x - parcel ?d - driver ?t - truck ?from - place ?to - place)
  (:distractors 0 2
    (?e - parcel (oneof (at ?e ?from) (at ?e ?to)))
    (?e - driver (at ?e ?to)))
  (:init
    (road ?from ?to) (road ?to ?from) (at ?x ?from) (at ?t ?from)
    (oneof (and (at ?d ?from) (unmanned ?t)) (driving ?d ?t)))
  (:goal (at ?x ?to)))
