; Many things on the table and on two fixtures, in and out of reach.
(define (template large)
  (:domain manipulation)
  (:array fixture (2) (each ?f (oneof (inworkspace ?f) (inworkspace ?f) (and))))
  (:array tool (2) (each ?d (on ?d (any fixture)) (inworkspace ?d)))
  (:array vessel (3)
    (each ?d
      (oneof (and (on ?d (any fixture)) (inworkspace ?d)) (on ?d table))
      (oneof (opened ?d) (and))))
  (:array container (3)
    (each ?d
      (oneof (and (on ?d (any fixture)) (inworkspace ?d)) (on ?d table))
      (oneof (opened ?d) (and))))
  (:array movable (8)
    (each ?d
      (oneof (and (on ?d (any fixture)) (inworkspace ?d))
             (and (in ?d (any container)) (inworkspace ?d))
             (on ?d table))))
  (:init (inworkspace table)))
