;; Several parents, either, constants, and an object that only problems declare.
(define (domain hierarchy)
  (:requirements :typing :equality)
  (:types area - object area - surface boat car - vehicle vehicle surface thing - object
          amphibian - boat amphibian - car)
  (:constants base - area spare - (either boat car))
  (:predicates (at ?v - (either vehicle thing) ?a - area) (afloat ?b - boat) (parked ?c - car) (on ?t - thing ?s - surface))
  (:action launch
    :parameters (?b - boat ?a - area)
    :precondition (and (at ?b ?a) (not (= ?a base)))
    :effect (afloat ?b))
  (:action park
    :parameters (?c - car)
    :precondition (at ?c base)
    :effect (and (parked ?c) (not (at ?c base)) (at ?c garage))))
