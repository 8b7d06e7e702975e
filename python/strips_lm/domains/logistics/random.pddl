; Two cities with an airport each; packages, places and trucks anywhere.
(define (template random)
  (:domain logistics)
  (:parameters ?c - city ?e - city ?here - airport ?there - airport ?t - truck ?p - plane)
  (:distractors 1 4
    (?d - package (at ?d (any place)))
    (?d - place (oneof (in-city ?d ?c) (in-city ?d ?e)))
    (?d - truck (at ?d ?there)))
  (:init (in-city ?here ?c) (in-city ?there ?e) (at ?t ?here) (oneof (at ?p ?here) (at ?p ?there))))
