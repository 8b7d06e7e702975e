//! The text that models read and write. This module is the only place that knows what a prompt and a plan look like.
//!
//! ```text
//! <|startoftext|> [<OBJECTS> cup vessel, shelf fixture ][<VOCAB> pick lift, place put[, on atop] ]<GOAL> on(cup, shelf) <INIT> …
//!     <ACTION> lift(cup) <STATE> inhand(cup), … <ACTION> … <STATE> … <|endoftext|>
//! ```
//!
//! A text is a prompt (up to the atoms of `<INIT>`), one space and a completion (from the first `<ACTION>`, or the end
//! token alone). Segments and their markers are joined by single spaces, atoms by a comma and a space; an atom without
//! arguments is written `handempty()`. This is the layout of the report's Figure 4 but for its line breaks.
//!
//! Rendering takes names and ids, parsing gives back slices of the text: what a name denotes, whether an action exists
//! and whether a plan works are others' questions. Parsing is total: it never fails on what a model writes, but says
//! how far the text made sense. Price: one pass over the bytes each way, a vector for each atom when parsing.

pub mod automaton;
pub mod canonical;
mod completion;
mod goal;
mod prompt;
mod render;
pub(crate) mod scan;

pub use completion::{Completion, Step, parse_completion, parse_completions};
pub use goal::goal_literals;
pub use prompt::{Prompt, TypedName, parse_prompt, parse_prompts, split_text};
pub use render::{Goal, Naming, render_atoms, render_completion, render_prompt, render_record};
pub use scan::{Malformed, TextAtom};

/// Opens every text.
pub const START: &str = "<|startoftext|>";
/// Before the goal.
pub const GOAL: &str = "<GOAL>";
/// Before the atoms of the initial state.
pub const INIT: &str = "<INIT>";
/// Before each action.
pub const ACTION: &str = "<ACTION>";
/// Before the state that an action leads to.
pub const STATE: &str = "<STATE>";
/// Before the objects and their types, in the typed style.
pub const OBJECTS: &str = "<OBJECTS>";
/// Before the words for the actions and, where they have any, for the predicates, in the typed style.
pub const VOCAB: &str = "<VOCAB>";
/// Ends every text. GPT-2's own end token, which pads as well.
pub const END: &str = "<|endoftext|>";

/// The tokens to be added to GPT-2's vocabulary, in order; with them it counts 50,264, as in the report.
pub const ADDED_TOKENS: [&str; 7] = [START, GOAL, INIT, ACTION, STATE, OBJECTS, VOCAB];

/// What a prompt says beside goal and initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Style {
    /// Nothing: exactly the report's layout.
    Paper,
    /// The objects with their types, and the words for actions and predicates where they are given.
    Typed,
}

impl Style {
    /// The style's name in configurations and data sets.
    pub fn name(self) -> &'static str {
        match self {
            Style::Paper => "paper",
            Style::Typed => "typed",
        }
    }

    /// The style of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Style::Paper, Style::Typed].into_iter().find(|style| style.name() == name)
    }
}

/// What stands after `<GOAL>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GoalStyle {
    /// The whole final state, as in the report.
    State,
    /// The problem's goal, as literals.
    Problem,
}

impl GoalStyle {
    /// The style's name in configurations and data sets.
    pub fn name(self) -> &'static str {
        match self {
            GoalStyle::State => "state",
            GoalStyle::Problem => "problem",
        }
    }

    /// The style of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [GoalStyle::State, GoalStyle::Problem].into_iter().find(|style| style.name() == name)
    }
}

#[cfg(test)]
pub(crate) mod tests;
