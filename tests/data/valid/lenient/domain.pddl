;; Real files: upper case, CRLF, a byte-order mark, glued variables, tight dashes, no requirements.
(DEFINE (DOMAIN Lenient)
  (:TYPES vehicle - object aircraft -vehicle town -place object)
  (:PREDICATES (Aircraft?a) (town ?x - town) (at ?x -vehicle ?y) (ready))
  (:ACTION Fly
    :PARAMETERS (?a -vehicle ?c)
    :PRECONDITION (AND (aircraft?a) () (AND))
    :EFFECT (AND (AT ?a ?C)))
  (:action nothing :parameters () :precondition () :effect ())
  (:action bare))
