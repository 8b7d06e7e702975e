; Three places with roads and a footpath; parcels, drivers and trucks anywhere.
(define (template random)
  (:domain driverlog)
  (:parameters ?a - place ?b - place ?c - place ?d - driver ?t - truck)
  (:distractors 1 4
    (?e - parcel (at ?e (any place)))
    (?e - driver (at ?e (any place)))
    (?e - truck (at ?e (any place)) (unmanned ?e)))
  (:init
    (road ?a ?b) (road ?b ?a) (road ?b ?c) (road ?c ?b) (footpath ?a ?c) (footpath ?c ?a)
    (at ?d ?a) (at ?t ?b) (unmanned ?t)))
