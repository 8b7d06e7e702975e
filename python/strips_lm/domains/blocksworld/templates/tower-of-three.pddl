; Builds a tower of three: from single blocks, from a tower of two, or from one in another order.
(define (template tower-of-three)
  (:domain blocksworld)
  (:parameters ?a - block ?b - block ?c - block)
  (:distractors 0 2
    (?d - block (ontable ?d) (clear ?d)))
  (:init
    (handempty)
    (oneof (and (ontable ?a) (clear ?a) (ontable ?b) (clear ?b) (ontable ?c) (clear ?c))
           (and (on ?b ?c) (clear ?b) (ontable ?c) (ontable ?a) (clear ?a))
           (and (on ?c ?a) (clear ?c) (ontable ?a) (ontable ?b) (clear ?b))))
  (:goal (and (on ?a ?b) (on ?b ?c))))
