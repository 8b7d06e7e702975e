; Blocks side by side; a random walk builds the towers.
(define (template random)
  (:domain blocksworld)
  (:parameters ?a - block)
  (:distractors 2 5
    (?d - block (ontable ?d) (clear ?d)))
  (:init (handempty) (ontable ?a) (clear ?a)))
