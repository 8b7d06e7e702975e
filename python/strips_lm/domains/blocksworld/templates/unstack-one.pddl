; Takes ?a off ?b and puts it on the table.
(define (template unstack-one)
  (:domain blocksworld)
  (:parameters ?a - block ?b - block)
  (:distractors 0 3
    (?d - block (ontable ?d) (clear ?d)))
  (:init (handempty) (on ?a ?b) (ontable ?b) (clear ?a))
  (:goal (and (ontable ?a) (clear ?b))))
