; Blocks on a table, and one hand that moves the topmost block of a tower.
(define (domain blocksworld)
  (:requirements :strips :typing)
  (:types block - object)
  (:predicates
    (handempty)
    (holding ?b - block)
    (ontable ?b - block)
    (on ?upper - block ?lower - block)
    (clear ?b - block))

  ; Lift a clear block off the table.
  (:action pick-up
    :parameters (?b - block)
    :precondition (and (handempty) (ontable ?b) (clear ?b))
    :effect (and (holding ?b) (not (handempty)) (not (ontable ?b)) (not (clear ?b))))

  ; Put the block in the hand on the table.
  (:action put-down
    :parameters (?b - block)
    :precondition (holding ?b)
    :effect (and (handempty) (ontable ?b) (clear ?b) (not (holding ?b))))

  ; Put the block in the hand on a clear block.
  (:action stack
    :parameters (?upper - block ?lower - block)
    :precondition (and (holding ?upper) (clear ?lower))
    :effect (and (handempty) (on ?upper ?lower) (clear ?upper) (not (holding ?upper)) (not (clear ?lower))))

  ; Lift a clear block off the block below it.
  (:action unstack
    :parameters (?upper - block ?lower - block)
    :precondition (and (handempty) (on ?upper ?lower) (clear ?upper))
    :effect (and (holding ?upper) (clear ?lower) (not (handempty)) (not (on ?upper ?lower)) (not (clear ?upper)))))
