; Puts ?a, which is on the shelf ?s, onto the table. The shelf itself may be out of reach: what stands on it is not.
(define (template fetch-from-shelf)
  (:domain manipulation)
  (:parameters ?a - (either movable tool vessel container) ?s - fixture)
  (:distractors 0 2
    (?d - (either movable tool)
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d))
             (on ?d ?s)))
    (?d - (either vessel container)
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d)))
      (oneof (opened ?d) (and))))
  (:init
    (inworkspace table)
    (oneof (inworkspace ?s) (and))
    (inworkspace ?a)
    (on ?a ?s))
  (:goal (on ?a table)))
