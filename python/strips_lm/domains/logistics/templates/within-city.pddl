; Brings ?x from one place of a city to another by truck.
(define (template within-city)
  (:domain logistics)
  (:parameters ?x - package ?t - truck ?from - place ?to - place ?c - city)
  (:distractors 0 2
    (?d - package (oneof (at ?d ?from) (at ?d ?to)))
    (?d - truck (at ?d ?to)))
  (:init (in-city ?from ?c) (in-city ?to ?c) (at ?x ?from) (oneof (at ?t ?from) (at ?t ?to)))
  (:goal (at ?x ?to)))
