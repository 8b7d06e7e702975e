; Many balls in two rooms, and a robot with two grippers.
(define (template large)
  (:domain gripper)
  (:parameters ?here ?there - room ?left ?right - gripper)
  (:array ball (20) (each ?b (oneof (in ?b ?here) (in ?b ?there))))
  (:init (robot-in ?here) (free ?left) (free ?right)))
