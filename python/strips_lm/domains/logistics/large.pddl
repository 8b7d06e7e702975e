; Four cities with an airport, another place and a truck each; two planes; packages anywhere.
(define (template large)
  (:domain logistics)
  (:parameters ?c1 ?c2 ?c3 ?c4 - city ?a1 ?a2 ?a3 ?a4 - airport ?p1 ?p2 ?p3 ?p4 - place
               ?t1 ?t2 ?t3 ?t4 - truck)
  (:array plane (2) (each ?v (at ?v (any airport))))
  (:array package (8) (each ?x (at ?x (any place))))
  (:init
    (in-city ?a1 ?c1) (in-city ?a2 ?c2) (in-city ?a3 ?c3) (in-city ?a4 ?c4)
    (in-city ?p1 ?c1) (in-city ?p2 ?c2) (in-city ?p3 ?c3) (in-city ?p4 ?c4)
    (oneof (at ?t1 ?a1) (at ?t1 ?p1)) (oneof (at ?t2 ?a2) (at ?t2 ?p2))
    (oneof (at ?t3 ?a3) (at ?t3 ?p3)) (oneof (at ?t4 ?a4) (at ?t4 ?p4))))
