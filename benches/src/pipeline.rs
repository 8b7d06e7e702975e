//! Batches of oil pushed through pipes. Wide actions over fluent atoms that are all reachable together: the joins
//! themselves are large, and the order in which atoms are joined decides.

use strips_core::random::Random;

use crate::Pddl;

const DOMAIN: &str = "\
(define (domain oil-pipeline)
  (:requirements :strips :typing)
  (:types pipe area product batch slot)
  (:predicates (joins ?p - pipe ?from ?to - area) (kind ?b - batch ?k - product) (may-touch ?a ?b - product)
    (stored ?b - batch ?a - area) (head ?b - batch ?p - pipe) (tail ?b - batch ?p - pipe)
    (tank ?s - slot ?k - product ?a - area) (full ?s - slot) (vacant ?s - slot) (idle ?p - pipe) (busy ?p - pipe)
    (before ?a ?b - batch))
  (:action push-single
    :parameters (?p - pipe ?from ?to - area ?in ?out - batch ?ki ?ko - product)
    :precondition (and (joins ?p ?from ?to) (stored ?in ?from) (kind ?in ?ki) (head ?out ?p) (tail ?out ?p)
      (kind ?out ?ko) (may-touch ?ki ?ko))
    :effect (and (not (stored ?in ?from)) (not (head ?out ?p)) (not (tail ?out ?p)) (head ?in ?p) (tail ?in ?p)
      (stored ?out ?to)))
  (:action push-begin
    :parameters (?p - pipe ?from ?to - area ?in ?first - batch ?ki ?kf - product ?s - slot)
    :precondition (and (idle ?p) (joins ?p ?from ?to) (stored ?in ?from) (kind ?in ?ki) (tail ?first ?p)
      (kind ?first ?kf) (may-touch ?ki ?kf) (tank ?s ?ki ?from) (full ?s))
    :effect (and (not (idle ?p)) (busy ?p) (not (stored ?in ?from)) (not (tail ?first ?p)) (tail ?in ?p)
      (before ?first ?in) (not (full ?s)) (vacant ?s)))
  (:action push-end
    :parameters (?p - pipe ?from ?to - area ?out ?next - batch ?ko - product ?s - slot)
    :precondition (and (busy ?p) (joins ?p ?from ?to) (head ?out ?p) (before ?out ?next) (kind ?out ?ko)
      (tank ?s ?ko ?to) (vacant ?s))
    :effect (and (not (busy ?p)) (idle ?p) (not (head ?out ?p)) (head ?next ?p) (not (before ?out ?next))
      (stored ?out ?to) (not (vacant ?s)) (full ?s))))
";

/// So many areas, joined in a ring both ways, and so many batches.
pub fn generate(areas: usize, batches: usize, seed: u64) -> Pddl {
    let mut random = Random::new(seed, 2);
    let products = 4;
    let mut objects: Vec<String> = (0..products).map(|product| format!("product{product} - product")).collect();
    let mut init = touching(products);
    for area in 0..areas {
        let next = (area + 1) % areas;
        objects.push(format!("area{area} - area pipe{area} - pipe"));
        init.push(format!("(joins pipe{area} area{area} area{next}) (joins pipe{area} area{next} area{area})"));
        init.push(format!("(idle pipe{area}) (head batch{area} pipe{area}) (tail batch{area} pipe{area})"));
        for product in 0..products {
            objects.push(format!("slot{area}-{product} - slot"));
            let state = if random.chance(0.5) { "full" } else { "vacant" };
            init.push(format!(
                "(tank slot{area}-{product} product{product} area{area}) ({state} slot{area}-{product})"
            ));
        }
    }
    for batch in 0..batches {
        objects.push(format!("batch{batch} - batch"));
        init.push(format!("(kind batch{batch} product{})", random.below(products)));
        if batch >= areas {
            init.push(format!("(stored batch{batch} area{})", random.below(areas)));
        }
    }
    let goal: Vec<String> = (areas..batches.max(areas + 1))
        .step_by(2)
        .map(|b| format!("(stored batch{} area{})", b % batches, random.below(areas)))
        .collect();
    Pddl::new(format!("pipeline-{areas}-{batches}"), DOMAIN, &objects, &init, &goal)
}

/// All products may touch but the first and the last.
fn touching(products: usize) -> Vec<String> {
    let pairs = (0..products * products).map(|pair| (pair / products, pair % products));
    let allowed = pairs.filter(|&(a, b)| a.abs_diff(b) + 1 < products);
    allowed.map(|(a, b)| format!("(may-touch product{a} product{b})")).collect()
}
