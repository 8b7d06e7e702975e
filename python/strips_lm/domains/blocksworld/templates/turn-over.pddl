; Turns a tower of two over.
(define (template turn-over)
  (:domain blocksworld)
  (:parameters ?a - block ?b - block)
  (:distractors 0 2
    (?d - block (ontable ?d) (clear ?d)))
  (:init (handempty) (on ?a ?b) (ontable ?b) (clear ?a))
  (:goal (on ?b ?a)))
