; The towers of Hanoi: a disc moves from the top of one pile to the top of another, never onto a smaller one.
(define (domain hanoi)
  (:requirements :strips :typing :equality)
  (:types
    support - object
    peg disc - support)
  (:predicates
    (clear ?s - support)
    (on ?d - disc ?s - support)
    (fits ?d - disc ?s - support))

  ; Move a clear disc from its support to another clear one that is larger.
  (:action move
    :parameters (?d - disc ?from - support ?to - support)
    :precondition (and (not (= ?from ?to)) (clear ?d) (on ?d ?from) (clear ?to) (fits ?d ?to))
    :effect (and (on ?d ?to) (clear ?from) (not (on ?d ?from)) (not (clear ?to)))))
