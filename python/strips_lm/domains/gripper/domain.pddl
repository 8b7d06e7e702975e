; A robot carries balls between rooms, one ball a gripper.
(define (domain gripper)
  (:requirements :strips :typing)
  (:types room ball gripper - object)
  (:predicates
    (robot-in ?r - room)
    (in ?b - ball ?r - room)
    (free ?g - gripper)
    (carries ?g - gripper ?b - ball))

  ; Drive from one room to any room, the same one included.
  (:action move
    :parameters (?from - room ?to - room)
    :precondition (robot-in ?from)
    :effect (and (robot-in ?to) (not (robot-in ?from))))

  ; Take a ball with a free gripper.
  (:action pick
    :parameters (?b - ball ?r - room ?g - gripper)
    :precondition (and (robot-in ?r) (in ?b ?r) (free ?g))
    :effect (and (carries ?g ?b) (not (in ?b ?r)) (not (free ?g))))

  ; Let a ball go in the room where the robot is.
  (:action drop
    :parameters (?b - ball ?r - room ?g - gripper)
    :precondition (and (robot-in ?r) (carries ?g ?b))
    :effect (and (in ?b ?r) (free ?g) (not (carries ?g ?b)))))
