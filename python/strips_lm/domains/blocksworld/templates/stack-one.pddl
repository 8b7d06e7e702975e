; Puts ?a on ?b; both stand on the table.
(define (template stack-one)
  (:domain blocksworld)
  (:parameters ?a - block ?b - block)
  (:distractors 0 3
    (?d - block (ontable ?d) (clear ?d)))
  (:init (handempty) (ontable ?a) (ontable ?b) (clear ?a) (clear ?b))
  (:goal (on ?a ?b)))
