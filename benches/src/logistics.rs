//! Packages, trucks and planes. Many operators from short joins: the output dominates.

use strips_core::random::Random;

use crate::Pddl;

const DOMAIN: &str = "\
(define (domain parcel-service)
  (:requirements :strips :typing)
  (:types truck plane - vehicle vehicle parcel - thing airport - place place city)
  (:predicates (at ?t - thing ?p - place) (inside ?p - parcel ?v - vehicle) (part-of ?p - place ?c - city))
  (:action load
    :parameters (?p - parcel ?v - vehicle ?l - place)
    :precondition (and (at ?p ?l) (at ?v ?l))
    :effect (and (not (at ?p ?l)) (inside ?p ?v)))
  (:action unload
    :parameters (?p - parcel ?v - vehicle ?l - place)
    :precondition (and (inside ?p ?v) (at ?v ?l))
    :effect (and (not (inside ?p ?v)) (at ?p ?l)))
  (:action drive
    :parameters (?t - truck ?from ?to - place ?c - city)
    :precondition (and (at ?t ?from) (part-of ?from ?c) (part-of ?to ?c))
    :effect (and (not (at ?t ?from)) (at ?t ?to)))
  (:action fly
    :parameters (?p - plane ?from ?to - airport)
    :precondition (at ?p ?from)
    :effect (and (not (at ?p ?from)) (at ?p ?to))))
";

/// So many cities with so many places each (the first an airport), planes and pieces of `cargo`; a truck in each city.
pub fn generate(cities: usize, sites: usize, planes: usize, cargo: usize, seed: u64) -> Pddl {
    let mut random = Random::new(seed, 0);
    let (mut objects, mut init) = (Vec::new(), Vec::new());
    for city in 0..cities {
        objects.push(format!("city{city} - city truck{city} - truck place{city}-0 - airport"));
        objects.extend((1..sites).map(|place| format!("place{city}-{place} - place")));
        init.extend((0..sites).map(|place| format!("(part-of place{city}-{place} city{city})")));
        init.push(format!("(at truck{city} place{city}-{})", random.below(sites)));
    }
    for plane in 0..planes {
        objects.push(format!("plane{plane} - plane"));
        init.push(format!("(at plane{plane} place{}-0)", random.below(cities)));
    }
    let mut somewhere =
        |parcel: usize| format!("(at parcel{parcel} place{}-{})", random.below(cities), random.below(sites));
    objects.extend((0..cargo).map(|parcel| format!("parcel{parcel} - parcel")));
    init.extend((0..cargo).map(&mut somewhere));
    let goal: Vec<String> = (0..cargo).map(&mut somewhere).collect();
    Pddl::new(format!("logistics-{cities}-{sites}-{planes}-{cargo}"), DOMAIN, &objects, &init, &goal)
}
