;; Every connective and quantifier, in preconditions, conditions of effects and the goal.
(define (domain connectives)
  (:requirements :adl)
  (:types room lamp)
  (:predicates (in ?x - lamp ?r - room) (lit ?x - lamp) (dark ?r - room) (at ?r - room) (joined ?r ?s - room) (done))
  (:action walk
    :parameters (?from ?to - room)
    :precondition (and (at ?from) (or (joined ?from ?to) (joined ?to ?from)) (not (= ?from ?to)))
    :effect (and (not (at ?from)) (at ?to)))
  (:action switch
    :parameters (?x - lamp)
    :precondition (exists (?r - room) (and (at ?r) (in ?x ?r)))
    :effect (and
      (when (lit ?x) (not (lit ?x)))
      (when (not (lit ?x)) (and (lit ?x) (forall (?r - room) (when (in ?x ?r) (not (dark ?r))))))
      (forall (?r - room) (when (and (lit ?x) (in ?x ?r)) (dark ?r)))))
  (:action finish
    :parameters ()
    :precondition (forall (?r - room) (imply (exists (?x - lamp) (in ?x ?r)) (not (dark ?r))))
    :effect (done)))
