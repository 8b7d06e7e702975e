; Places in a grid, with roads and footpaths between neighbours; drivers, trucks and parcels anywhere.
(define (template large)
  (:domain driverlog)
  (:array place (3 3) (neighbours ?a ?b (road ?a ?b) (road ?b ?a) (footpath ?a ?b) (footpath ?b ?a)))
  (:array driver (3) (each ?d (at ?d (any place))))
  (:array truck (3) (each ?t (at ?t (any place)) (unmanned ?t)))
  (:array parcel (8) (each ?x (at ?x (any place)))))
