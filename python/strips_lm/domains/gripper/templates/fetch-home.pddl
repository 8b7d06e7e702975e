; Fetches ?b from ?there; the robot ends where it began.
(define (template fetch-home)
  (:domain gripper)
  (:parameters ?b - ball ?home - room ?there - room ?only - gripper)
  (:distractors 0 2
    (?d - ball (oneof (in ?d ?home) (in ?d ?there)))
    (?d - gripper (free ?d)))
  (:init (in ?b ?there) (robot-in ?home) (free ?only))
  (:goal (and (in ?b ?home) (robot-in ?home))))
