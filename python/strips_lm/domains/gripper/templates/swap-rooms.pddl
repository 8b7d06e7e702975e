; Two balls change rooms.
(define (template swap-rooms)
  (:domain gripper)
  (:parameters ?b - ball ?c - ball ?here - room ?there - room ?left - gripper ?right - gripper)
  (:distractors 0 1
    (?d - ball (oneof (in ?d ?here) (in ?d ?there))))
  (:init (in ?b ?here) (in ?c ?there) (robot-in ?here) (free ?left) (free ?right))
  (:goal (and (in ?b ?there) (in ?c ?here))))
