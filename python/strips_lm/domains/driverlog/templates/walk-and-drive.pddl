; The driver walks to the truck and drives it to ?to.
(define (template walk-and-drive)
  (:domain driverlog)
  (:parameters ?d - driver ?t - truck ?home - place ?yard - place ?to - place)
  (:distractors 0 2
    (?e - parcel (oneof (at ?e ?home) (in ?e ?t)))
    (?e - truck (at ?e ?to) (unmanned ?e)))
  (:init
    (footpath ?home ?yard) (footpath ?yard ?home) (road ?yard ?to) (road ?to ?yard)
    (at ?d ?home) (at ?t ?yard) (unmanned ?t))
  (:goal (at ?t ?to)))
