; Balls in two rooms or more; one gripper or two.
(define (template random)
  (:domain gripper)
  (:parameters ?here - room ?there - room ?one - gripper)
  (:distractors 2 5
    (?d - ball (in ?d (any room)))
    (?d - room (and))
    (?d - gripper (free ?d)))
  (:init (robot-in ?here) (free ?one)))
