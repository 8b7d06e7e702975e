; Takes ?c across.
(define (template cross-one)
  (:domain ferry)
  (:parameters ?c - car ?from - shore ?to - shore)
  (:distractors 0 3
    (?d - car (oneof (at ?d ?from) (at ?d ?to)))
    (?d - shore (and)))
  (:init (empty) (at ?c ?from) (oneof (ferry-at ?from) (ferry-at ?to)))
  (:goal (at ?c ?to)))
