; Sets the car that is aboard ashore at ?to, and leaves the ferry at ?home.
(define (template unload)
  (:domain ferry)
  (:parameters ?c - car ?home - shore ?to - shore)
  (:distractors 0 3
    (?d - car (oneof (at ?d ?home) (at ?d ?to)))
    (?d - shore (and)))
  (:init (aboard ?c) (ferry-at ?home))
  (:goal (and (at ?c ?to) (ferry-at ?home))))
