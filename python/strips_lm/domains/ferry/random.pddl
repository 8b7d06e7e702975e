; Cars on two shores or more.
(define (template random)
  (:domain ferry)
  (:parameters ?home - shore ?there - shore ?c - car)
  (:distractors 1 5
    (?d - car (at ?d (any shore)))
    (?d - shore (and)))
  (:init (empty) (ferry-at ?home) (oneof (at ?c ?home) (at ?c ?there))))
