; Flies ?x from one airport to another.
(define (template by-air)
  (:domain logistics)
  (:parameters ?x - package ?p - plane ?from - airport ?to - airport ?c - city ?e - city)
  (:distractors 0 2
    (?d - package (oneof (at ?d ?from) (at ?d ?to) (in ?d ?p)))
    (?d - truck (oneof (at ?d ?from) (at ?d ?to))))
  (:init (in-city ?from ?c) (in-city ?to ?e) (at ?x ?from) (oneof (at ?p ?from) (at ?p ?to)))
  (:goal (at ?x ?to)))
