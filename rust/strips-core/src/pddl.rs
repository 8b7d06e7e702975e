//! PDDL: text to a checked syntax tree, and back. The only place that knows the language's surface.

pub mod ast;
