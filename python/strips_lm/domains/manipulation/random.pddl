; Where random problems start: a template without a goal. Its choices are drawn, not listed; a random walk then
; scrambles the state, and the goal is taken from a state that is reachable at a drawn distance.
; (any TYPE) is some object placed before this one.
(define (template random)
  (:domain manipulation)
  (:parameters ?s - fixture)
  (:distractors 2 5
    (?d - movable
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d))
             (and (on ?d (any movable)) (inworkspace ?d))
             (and (in ?d (any container)) (inworkspace ?d))
             (on ?d table)))
    (?d - tool
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d))
             (and (in ?d (any container)) (inworkspace ?d))))
    (?d - (either vessel container)
      (oneof (and (on ?d table) (inworkspace ?d))
             (and (on ?d ?s) (inworkspace ?d))
             (on ?d table))
      (oneof (opened ?d) (and))))
  (:init
    (inworkspace table)
    (oneof (inworkspace ?s) (inworkspace ?s) (and))))
