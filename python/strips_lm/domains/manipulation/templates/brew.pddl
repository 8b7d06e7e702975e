; Moves the vessel ?v from the shelf ?s to the table, opens it and puts ?a on it: the cup and the teabag.
; The shelf is out of reach as a place to put things, or not.
(define (template brew)
  (:domain manipulation)
  (:parameters ?a - (either movable tool) ?v - vessel ?s - fixture)
  (:distractors 0 2
    (?d - (either movable tool)
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d))
             (on ?d table)))
    (?d - (either vessel container)
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d)))
      (oneof (opened ?d) (and))))
  (:init
    (inworkspace table)
    (oneof (and) (inworkspace ?s))
    (inworkspace ?a)
    (inworkspace ?v)
    (on ?a ?s)
    (on ?v ?s))
  (:goal (and (on ?a ?v) (on ?v table) (opened ?v))))
