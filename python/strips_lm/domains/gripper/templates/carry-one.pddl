; Brings ?b from the room where the robot is, or from another, to ?to.
(define (template carry-one)
  (:domain gripper)
  (:parameters ?b - ball ?from - room ?to - room ?left - gripper ?right - gripper)
  (:distractors 0 2
    (?d - ball (oneof (in ?d ?from) (in ?d ?to)))
    (?d - room (and)))
  (:init (in ?b ?from) (oneof (robot-in ?from) (robot-in ?to)) (free ?left) (free ?right))
  (:goal (in ?b ?to)))
