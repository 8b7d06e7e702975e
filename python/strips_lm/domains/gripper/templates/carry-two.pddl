; Brings two balls to ?to in one trip.
(define (template carry-two)
  (:domain gripper)
  (:parameters ?b - ball ?c - ball ?from - room ?to - room ?left - gripper ?right - gripper)
  (:distractors 0 1
    (?d - ball (oneof (in ?d ?from) (in ?d ?to))))
  (:init (in ?b ?from) (in ?c ?from) (oneof (robot-in ?from) (robot-in ?to)) (free ?left) (free ?right))
  (:goal (and (in ?b ?to) (in ?c ?to))))
