//! The plan set against a naive enumerator, on random tasks and on hand-built ones.
//!
//! `STRIPS_LM_TASKS=100000 cargo test --release -p strips-core --test search` is the long run; the normal one has 2,000 tasks.

mod greedy;
mod laws;
mod naive;
mod oracle_cases;
mod random_task;
mod reproducible;
mod state_graph;
