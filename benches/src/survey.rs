//! Rovers that survey a planet. Wide actions (up to six parameters) whose static atoms prune all but a few bindings.

use strips_core::random::Random;

use crate::Pddl;

const DOMAIN: &str = "\
(define (domain planet-survey)
  (:requirements :strips :typing)
  (:types rover site camera filter target base store)
  (:predicates (at ?r - rover ?s - site) (route ?r - rover ?a ?b - site) (sees ?a ?b - site)
    (base-at ?b - base ?s - site) (mounted ?c - camera ?r - rover) (offers ?c - camera ?f - filter)
    (target-seen ?t - target ?s - site) (calibration ?c - camera ?t - target) (calibrated ?c - camera ?r - rover)
    (image ?r - rover ?t - target ?f - filter) (sent-image ?t - target ?f - filter)
    (sample-at ?s - site) (has-drill ?r - rover) (store-of ?x - store ?r - rover) (free ?x - store)
    (analysed ?r - rover ?s - site) (sent-sample ?s - site) (link-free ?b - base))
  (:action travel
    :parameters (?r - rover ?a ?b - site)
    :precondition (and (route ?r ?a ?b) (at ?r ?a) (sees ?a ?b))
    :effect (and (not (at ?r ?a)) (at ?r ?b)))
  (:action drill
    :parameters (?r - rover ?x - store ?s - site)
    :precondition (and (at ?r ?s) (sample-at ?s) (has-drill ?r) (store-of ?x ?r) (free ?x))
    :effect (and (not (free ?x)) (not (sample-at ?s)) (analysed ?r ?s)))
  (:action empty
    :parameters (?r - rover ?x - store)
    :precondition (store-of ?x ?r)
    :effect (free ?x))
  (:action calibrate
    :parameters (?r - rover ?c - camera ?t - target ?s - site)
    :precondition (and (mounted ?c ?r) (calibration ?c ?t) (at ?r ?s) (target-seen ?t ?s))
    :effect (calibrated ?c ?r))
  (:action photograph
    :parameters (?r - rover ?s - site ?t - target ?c - camera ?f - filter)
    :precondition (and (calibrated ?c ?r) (mounted ?c ?r) (offers ?c ?f) (target-seen ?t ?s) (at ?r ?s))
    :effect (and (image ?r ?t ?f) (not (calibrated ?c ?r))))
  (:action send-sample
    :parameters (?r - rover ?b - base ?s ?from ?to - site)
    :precondition (and (at ?r ?from) (base-at ?b ?to) (analysed ?r ?s) (sees ?from ?to) (link-free ?b))
    :effect (sent-sample ?s))
  (:action send-image
    :parameters (?r - rover ?b - base ?t - target ?f - filter ?from ?to - site)
    :precondition (and (at ?r ?from) (base-at ?b ?to) (image ?r ?t ?f) (sees ?from ?to) (link-free ?b))
    :effect (sent-image ?t ?f)))
";

/// So many rovers, sites, targets and cameras.
pub fn generate(rovers: usize, sites: usize, targets: usize, cameras: usize, seed: u64) -> Pddl {
    let mut random = Random::new(seed, 1);
    let filters = ["colour", "infrared", "narrow"];
    let mut objects: Vec<String> = filters.iter().map(|filter| format!("{filter} - filter")).collect();
    objects.push("home - base".to_owned());
    let mut init = vec![format!("(base-at home site{})", random.below(sites)), "(link-free home)".to_owned()];
    add_sites(&mut random, sites, &mut objects, &mut init);
    add_rovers(&mut random, rovers, sites, &mut objects, &mut init);
    objects.extend((0..targets).map(|target| format!("target{target} - target")));
    for target in 0..targets {
        let sightings = (0..=sites / 4).map(|_| format!("(target-seen target{target} site{})", random.below(sites)));
        init.extend(sightings.collect::<Vec<_>>());
    }
    for camera in 0..cameras {
        objects.push(format!("camera{camera} - camera"));
        init.push(format!("(mounted camera{camera} rover{})", camera % rovers));
        init.push(format!("(calibration camera{camera} target{})", random.below(targets)));
        let offered =
            filters.iter().filter(|_| random.chance(0.7)).map(|filter| format!("(offers camera{camera} {filter})"));
        init.extend(offered.collect::<Vec<_>>());
    }
    let mut goal: Vec<String> =
        (0..targets).step_by(3).map(|target| format!("(sent-image target{target} colour)")).collect();
    goal.extend((0..sites).step_by(5).map(|site| format!("(sent-sample site{site})")));
    Pddl::new(format!("survey-{rovers}-{sites}-{targets}-{cameras}"), DOMAIN, &objects, &init, &goal)
}

/// Sites on a random tree with chords; each sees its neighbours.
fn add_sites(random: &mut Random, sites: usize, objects: &mut Vec<String>, init: &mut Vec<String>) {
    objects.extend((0..sites).map(|site| format!("site{site} - site")));
    for site in 0..sites {
        for _ in 0..if site == 0 { 0 } else { 3 } {
            let other = random.below(site);
            init.push(format!("(sees site{site} site{other}) (sees site{other} site{site})"));
        }
        if site % 5 == 0 || random.chance(0.3) {
            init.push(format!("(sample-at site{site})"));
        }
    }
}

/// Rovers that may take nearly every pair of sites, so that `sees` must prune.
fn add_rovers(random: &mut Random, rovers: usize, sites: usize, objects: &mut Vec<String>, init: &mut Vec<String>) {
    for rover in 0..rovers {
        objects.push(format!("rover{rover} - rover store{rover} - store"));
        init.push(format!("(at rover{rover} site{}) (has-drill rover{rover})", random.below(sites)));
        init.push(format!("(store-of store{rover} rover{rover}) (free store{rover})"));
        for (from, to) in (0..sites * sites).map(|pair| (pair / sites, pair % sites)) {
            if random.chance(0.8) {
                init.push(format!("(route rover{rover} site{from} site{to})"));
            }
        }
    }
}
