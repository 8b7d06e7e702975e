; Drivers walk on footpaths and drive trucks on roads; trucks carry parcels.
(define (domain driverlog)
  (:requirements :strips :typing)
  (:types
    place locatable - object
    driver truck parcel - locatable)
  (:predicates
    (at ?x - locatable ?p - place)
    (in ?x - parcel ?t - truck)
    (driving ?d - driver ?t - truck)
    (unmanned ?t - truck)
    (road ?a - place ?b - place)
    (footpath ?a - place ?b - place))

  ; Put a parcel into a truck.
  (:action load
    :parameters (?x - parcel ?t - truck ?p - place)
    :precondition (and (at ?t ?p) (at ?x ?p))
    :effect (and (in ?x ?t) (not (at ?x ?p))))

  ; Take a parcel out of a truck.
  (:action unload
    :parameters (?x - parcel ?t - truck ?p - place)
    :precondition (and (at ?t ?p) (in ?x ?t))
    :effect (and (at ?x ?p) (not (in ?x ?t))))

  ; Get into a truck that nobody drives.
  (:action board
    :parameters (?d - driver ?t - truck ?p - place)
    :precondition (and (at ?t ?p) (at ?d ?p) (unmanned ?t))
    :effect (and (driving ?d ?t) (not (at ?d ?p)) (not (unmanned ?t))))

  ; Get out of a truck.
  (:action alight
    :parameters (?d - driver ?t - truck ?p - place)
    :precondition (and (at ?t ?p) (driving ?d ?t))
    :effect (and (at ?d ?p) (unmanned ?t) (not (driving ?d ?t))))

  ; Drive along a road.
  (:action drive
    :parameters (?t - truck ?from - place ?to - place ?d - driver)
    :precondition (and (at ?t ?from) (driving ?d ?t) (road ?from ?to))
    :effect (and (at ?t ?to) (not (at ?t ?from))))

  ; Walk along a footpath.
  (:action walk
    :parameters (?d - driver ?from - place ?to - place)
    :precondition (and (at ?d ?from) (footpath ?from ?to))
    :effect (and (at ?d ?to) (not (at ?d ?from)))))
