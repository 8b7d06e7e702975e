; A ferry takes cars across, one at a time.
(define (domain ferry)
  (:requirements :strips :typing :equality :negative-preconditions)
  (:types car shore - object)
  (:predicates
    (ferry-at ?s - shore)
    (at ?c - car ?s - shore)
    (aboard ?c - car)
    (empty))

  ; Cross to another shore.
  (:action sail
    :parameters (?from - shore ?to - shore)
    :precondition (and (not (= ?from ?to)) (ferry-at ?from))
    :effect (and (ferry-at ?to) (not (ferry-at ?from))))

  ; Drive a car onto the empty ferry.
  (:action board
    :parameters (?c - car ?s - shore)
    :precondition (and (ferry-at ?s) (at ?c ?s) (empty))
    :effect (and (aboard ?c) (not (at ?c ?s)) (not (empty))))

  ; Drive the car off.
  (:action debark
    :parameters (?c - car ?s - shore)
    :precondition (and (ferry-at ?s) (aboard ?c))
    :effect (and (at ?c ?s) (empty) (not (aboard ?c)))))
