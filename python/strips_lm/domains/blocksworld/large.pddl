; Many blocks, which a random walk piles up.
(define (template large)
  (:domain blocksworld)
  (:array block (15) (each ?b (ontable ?b) (clear ?b)))
  (:init (handempty)))
