;; Derived predicates in two strata: reachability, and its complement.
(define (domain axioms)
  (:requirements :strips :typing :derived-predicates :negative-preconditions)
  (:types place)
  (:predicates (road ?a ?b - place) (broken ?a ?b - place) (at ?a - place)
               (reach ?a ?b - place) (cut-off ?a - place) (mended))
  (:derived (reach ?a ?b) (and (road ?a ?b) (not (broken ?a ?b))))
  (:derived (reach ?a ?c - place) (exists (?b - place) (and (reach ?a ?b) (reach ?b ?c))))
  (:derived (cut-off ?b) (forall (?a - place) (not (reach ?a ?b))))
  (:action mend
    :parameters (?a ?b - place)
    :precondition (and (at ?a) (road ?a ?b) (broken ?a ?b))
    :effect (and (not (broken ?a ?b)) (mended)))
  (:action jump
    :parameters (?a ?b - place)
    :precondition (and (at ?a) (reach ?a ?b))
    :effect (and (at ?b) (not (at ?a)))))
