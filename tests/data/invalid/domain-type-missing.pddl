(define (domain broken)
  (:requirements :strips :typing :negative-preconditions)
  (:types block table - object)
  (:constants floor - table)
  (:predicates (on ?x - block ?y - object) (clear ?x - object) (holding ?x - block) (above ?x ?y - block))
  (:action lift
    :parameters (?x -)
    :precondition (clear ?x)
    :effect (holding ?x)))
