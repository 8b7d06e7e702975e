; Brings two packages to one place.
(define (template two-packages)
  (:domain logistics)
  (:parameters ?x - package ?y - package ?t - truck ?from - place ?to - place ?c - city)
  (:distractors 0 2
    (?d - package (oneof (at ?d ?from) (at ?d ?to)))
    (?d - place (in-city ?d ?c)))
  (:init (in-city ?from ?c) (in-city ?to ?c) (at ?x ?from) (at ?t ?from) (oneof (at ?y ?from) (in ?y ?t)))
  (:goal (and (at ?x ?to) (at ?y ?to))))
