; Takes two cars across, one after the other.
(define (template cross-two)
  (:domain ferry)
  (:parameters ?b - car ?c - car ?from - shore ?to - shore)
  (:distractors 0 2
    (?d - car (oneof (at ?d ?from) (at ?d ?to))))
  (:init (empty) (at ?b ?from) (at ?c ?from) (ferry-at ?from))
  (:goal (and (at ?b ?to) (at ?c ?to))))
