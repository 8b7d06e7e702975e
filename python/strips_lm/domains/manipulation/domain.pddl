; Tabletop manipulation with one arm: five actions, five predicates.
;
; What the words mean
;   inhand ?a        the gripper holds ?a; it holds at most one thing
;   inworkspace ?a   the arm can reach ?a where it is; something far away on the table is not in the workspace
;   on ?a ?b         ?a stands on ?b: a fixture, another movable thing, or an opened vessel (the teabag on the cup)
;   in ?a ?b         ?a is inside the container ?b
;   opened ?a        ?a has its lid off
; States are printed with the predicates in this order.
;
; PDDL cannot ask for an object's type directly. "?b is a container" is written (exists (?c - container) (= ?c ?b));
; grounding decides such conditions once, so they cost nothing later.

(define (domain manipulation)
  (:requirements :typing :equality :negative-preconditions :disjunctive-preconditions
                 :existential-preconditions :universal-preconditions :conditional-effects)

  (:types
    physobj - object
    movable fixture - physobj
    tool openable - movable
    vessel container - openable)

  (:constants table - fixture)

  (:predicates
    (inhand ?a - movable)
    (inworkspace ?a - physobj)
    (on ?a - movable ?b - physobj)
    (in ?a - movable ?b - container)
    (opened ?a - openable))

  ; Takes ?a into the empty hand. Nothing may stand on it or lie in it, and no lid may be between it and the hand.
  (:action pick
    :parameters (?a - movable)
    :precondition (and
      (not (exists (?x - movable) (inhand ?x)))
      (inworkspace ?a)
      (not (exists (?x - movable) (on ?x ?a)))
      (not (exists (?c - container ?x - movable) (and (= ?c ?a) (in ?x ?c))))
      (not (exists (?c - container) (and (in ?a ?c) (not (opened ?c)))))
      (not (exists (?v - vessel) (and (on ?a ?v) (not (opened ?v))))))
    :effect (and
      (inhand ?a)
      (forall (?b - physobj) (not (on ?a ?b)))
      (forall (?c - container) (not (in ?a ?c)))))

  ; Puts what is held onto ?b, or into it where ?b is a container. Lids must be off, and things that have a lid
  ; themselves only stand on fixtures.
  (:action place
    :parameters (?a - movable ?b - physobj)
    :precondition (and
      (not (= ?a ?b))
      (inhand ?a)
      (inworkspace ?b)
      (forall (?o - openable) (imply (= ?o ?b) (opened ?o)))
      (imply (exists (?o - openable) (= ?o ?a)) (exists (?f - fixture) (= ?f ?b))))
    :effect (and
      (not (inhand ?a))
      (forall (?c - container) (when (= ?c ?b) (in ?a ?c)))
      (when (not (exists (?c - container) (= ?c ?b))) (on ?a ?b))))

  ; Brings ?a, which stands out of reach on ?f, into the workspace with the tool in the hand.
  (:action push
    :parameters (?t - tool ?a - movable ?f - fixture)
    :precondition (and
      (not (= ?t ?a))
      (inhand ?t)
      (on ?a ?f)
      (inworkspace ?f)
      (not (inworkspace ?a)))
    :effect (inworkspace ?a))

  ; Takes the lid off, with the empty hand.
  (:action open
    :parameters (?a - openable)
    :precondition (and
      (not (exists (?x - movable) (inhand ?x)))
      (inworkspace ?a)
      (not (opened ?a)))
    :effect (opened ?a))

  ; Puts the lid back on, with the empty hand.
  (:action close
    :parameters (?a - openable)
    :precondition (and
      (not (exists (?x - movable) (inhand ?x)))
      (inworkspace ?a)
      (opened ?a))
    :effect (not (opened ?a))))
