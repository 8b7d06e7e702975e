; Puts ?a, over which a block stands, on ?b.
(define (template dig-out)
  (:domain blocksworld)
  (:parameters ?a - block ?over - block ?b - block)
  (:distractors 0 2
    (?d - block (ontable ?d) (clear ?d)))
  (:init (handempty) (on ?over ?a) (clear ?over) (ontable ?a) (ontable ?b) (clear ?b))
  (:goal (on ?a ?b)))
