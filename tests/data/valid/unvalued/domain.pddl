;; A cost that no problem gives.
(define (domain unvalued)
  (:requirements :strips :action-costs)
  (:predicates (here) (there))
  (:functions (total-cost) - number (toll) - number)
  (:action cross
    :precondition (here)
    :effect (and (not (here)) (there) (increase (total-cost) (toll)))))
