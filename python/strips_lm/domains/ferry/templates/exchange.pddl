; Two cars change shores.
(define (template exchange)
  (:domain ferry)
  (:parameters ?b - car ?c - car ?here - shore ?there - shore)
  (:distractors 0 2
    (?d - car (oneof (at ?d ?here) (at ?d ?there))))
  (:init (empty) (at ?b ?here) (at ?c ?there) (ferry-at ?here))
  (:goal (and (at ?b ?there) (at ?c ?here))))
