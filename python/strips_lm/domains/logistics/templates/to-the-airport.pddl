; Brings ?x by truck to the airport and flies it on.
(define (template to-the-airport)
  (:domain logistics)
  (:parameters ?x - package ?t - truck ?p - plane ?depot - place ?here - airport ?there - airport ?c - city ?e - city)
  (:distractors 0 1
    (?d - package (oneof (at ?d ?depot) (at ?d ?there))))
  (:init (in-city ?depot ?c) (in-city ?here ?c) (in-city ?there ?e) (at ?x ?depot) (at ?t ?depot) (at ?p ?here))
  (:goal (at ?x ?there)))
