; A walker on a graph who is to set foot on given cells.
(define (domain visitall)
  (:requirements :strips :typing)
  (:types cell - object)
  (:predicates
    (walker-at ?c - cell)
    (visited ?c - cell)
    (connected ?a - cell ?b - cell))

  ; Step to a neighbouring cell.
  (:action step
    :parameters (?from - cell ?to - cell)
    :precondition (and (walker-at ?from) (connected ?from ?to))
    :effect (and (walker-at ?to) (visited ?to) (not (walker-at ?from)))))
