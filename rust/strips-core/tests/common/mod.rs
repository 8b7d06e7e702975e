//! What the integration tests share: random small tasks, and a slow obvious interpreter of PDDL to compare with.
#![allow(dead_code, reason = "each test binary uses its part")]

pub mod mutation;
pub mod naive;
pub mod random_task;
