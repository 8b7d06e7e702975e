;; Action costs: a constant and a table.
(define (domain costs)
  (:requirements :strips :typing :action-costs)
  (:types town)
  (:predicates (at ?t - town) (road ?a ?b - town) (rested))
  (:functions (total-cost) - number (distance ?a ?b - town) - number)
  (:action drive
    :parameters (?a ?b - town)
    :precondition (and (at ?a) (road ?a ?b))
    :effect (and (not (at ?a)) (at ?b) (increase (total-cost) (distance ?a ?b))))
  (:action rest
    :effect (and (rested) (increase (total-cost) 0.5))))
