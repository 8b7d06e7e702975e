; The driver leaves the truck at ?yard and walks home.
(define (template go-home)
  (:domain driverlog)
  (:parameters ?d - driver ?t - truck ?away - place ?yard - place ?home - place)
  (:distractors 0 2
    (?e - parcel (oneof (in ?e ?t) (at ?e ?yard)))
    (?e - driver (at ?e ?home)))
  (:init
    (road ?away ?yard) (road ?yard ?away) (footpath ?yard ?home) (footpath ?home ?yard)
    (driving ?d ?t) (oneof (at ?t ?away) (at ?t ?yard)))
  (:goal (and (at ?d ?home) (at ?t ?yard))))
