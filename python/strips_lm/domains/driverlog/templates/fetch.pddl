; Fetches ?x from ?there; the truck begins and the parcel ends at ?home.
(define (template fetch)
  (:domain driverlog)
  (:parameters ?x - parcel ?d - driver ?t - truck ?home - place ?there - place)
  (:distractors 0 1
    (?e - parcel (oneof (at ?e ?home) (at ?e ?there))))
  (:init (road ?home ?there) (road ?there ?home) (at ?x ?there) (at ?t ?home) (at ?d ?home) (unmanned ?t))
  (:goal (at ?x ?home)))
