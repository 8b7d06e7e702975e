//! Tasks of the field's classics at any size, as PDDL problems of our own domains.

use crate::Pddl;

const BLOCKSWORLD: &str = include_str!("../../python/strips_lm/domains/blocksworld/domain.pddl");
const GRIPPER: &str = include_str!("../../python/strips_lm/domains/gripper/domain.pddl");

/// Shopping for an evening: one of five things of each of five kinds, and two errands that undo nothing.
const EVENING: &str = "(define (domain evening) (:requirements :strips :typing) (:types kind thing - object)
  (:predicates (of ?t - thing ?k - kind) (have ?k - kind) (rewound) (counted))
  (:action rewind :effect (and (rewound)))
  (:action count :precondition (rewound) :effect (and (counted)))
  (:action get :parameters (?t - thing ?k - kind) :precondition (of ?t ?k) :effect (and (have ?k))))";

/// Blocks in one tower, to be turned upside down.
pub fn blocksworld(blocks: usize) -> Pddl {
    let top = format!("(clear b{})", blocks - 1);
    let tower = |lower: usize, upper: usize| format!("(on b{upper} b{lower})");
    let mut init = vec!["(handempty)".to_owned(), "(ontable b0)".to_owned(), top];
    init.extend((1..blocks).map(|upper| tower(upper - 1, upper)));
    let goal: Vec<String> = (1..blocks).map(|upper| tower(upper, upper - 1)).collect();
    Pddl::new(format!("blocksworld-{blocks}"), BLOCKSWORLD, &objects("b", blocks, "block"), &init, &goal)
}

/// Two rooms, two grippers and so many balls to carry over.
pub fn gripper(balls: usize) -> Pddl {
    let all = [objects("r", 2, "room"), objects("g", 2, "gripper"), objects("b", balls, "ball")].concat();
    let mut init: Vec<String> = ["(robot-in r0)", "(free g0)", "(free g1)"].map(str::to_owned).to_vec();
    init.extend((0..balls).map(|ball| format!("(in b{ball} r0)")));
    let goal: Vec<String> = (0..balls).map(|ball| format!("(in b{ball} r1)")).collect();
    Pddl::new(format!("gripper-{balls}"), GRIPPER, &all, &init, &goal)
}

/// Shopping for five kinds of thing, with two errands on the side: 858,375,000 plans of at most eight steps.
pub fn evening() -> Pddl {
    let init: Vec<String> = (0..25).map(|thing| format!("(of t{thing} k{})", thing / 5)).collect();
    let goal: Vec<String> = (0..5).map(|kind| format!("(have k{kind})")).chain(["(counted)".to_owned()]).collect();
    Pddl::new(
        "evening".to_owned(),
        EVENING,
        &[objects("k", 5, "kind"), objects("t", 25, "thing")].concat(),
        &init,
        &goal,
    )
}

fn objects(letter: &str, count: usize, kind: &str) -> Vec<String> {
    (0..count).map(|number| format!("{letter}{number} - {kind}")).collect()
}
