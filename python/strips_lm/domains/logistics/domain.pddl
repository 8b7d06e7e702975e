; Packages travel by truck within a city and by plane between airports.
(define (domain logistics)
  (:requirements :strips :typing)
  (:types
    package vehicle place city - object
    truck plane - vehicle
    airport - place)
  (:predicates
    (at ?x - (either package vehicle) ?p - place)
    (in ?x - package ?v - vehicle)
    (in-city ?p - place ?c - city))

  ; Load a package into a vehicle at the same place.
  (:action load
    :parameters (?x - package ?v - vehicle ?p - place)
    :precondition (and (at ?x ?p) (at ?v ?p))
    :effect (and (in ?x ?v) (not (at ?x ?p))))

  ; Unload a package where its vehicle stands.
  (:action unload
    :parameters (?x - package ?v - vehicle ?p - place)
    :precondition (and (in ?x ?v) (at ?v ?p))
    :effect (and (at ?x ?p) (not (in ?x ?v))))

  ; Drive between two places of one city.
  (:action drive
    :parameters (?t - truck ?from - place ?to - place ?c - city)
    :precondition (and (at ?t ?from) (in-city ?from ?c) (in-city ?to ?c))
    :effect (and (at ?t ?to) (not (at ?t ?from))))

  ; Fly between two airports.
  (:action fly
    :parameters (?p - plane ?from - airport ?to - airport)
    :precondition (at ?p ?from)
    :effect (and (at ?p ?to) (not (at ?p ?from)))))
