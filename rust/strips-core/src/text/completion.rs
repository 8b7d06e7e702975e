//! Completions: what a model writes after a prompt.

use rayon::prelude::*;

use super::scan::{Malformed, Scanner, Spacing, TextAtom};
use super::{ACTION, END, STATE};

/// A completion, as far as it makes sense.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Completion<'a> {
    /// The steps that could be read.
    pub steps: Vec<Step<'a>>,
    /// Whether the end token was reached; what follows it is ignored.
    pub finished: bool,
    /// Where and why reading stopped before; `None` also for a text that just breaks off between two segments.
    pub malformed: Option<Malformed>,
}

/// One (action, state) pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step<'a> {
    /// The action's word and arguments.
    pub action: TextAtom<'a>,
    /// The state after it, if the text says one that can be read.
    pub state: Option<Vec<TextAtom<'a>>>,
}

/// Reads a completion. Never fails: what cannot be read ends the steps and is told in [`Completion::malformed`].
///
/// White space may be anything, so that a plan with line breaks between its segments is read as well.
///
/// ```
/// use strips_core::text::parse_completion;
/// let completion = parse_completion("<ACTION> lift(cup) <STATE> inhand(cup) <ACTION> put(cup, <STATE>");
/// assert_eq!(completion.steps.len(), 1);
/// assert_eq!(completion.malformed.map(|malformed| malformed.offset), Some(57));
/// ```
pub fn parse_completion(text: &str) -> Completion<'_> {
    let mut completion = Completion::default();
    completion.malformed = read_steps(&mut Scanner::new(text, Spacing::Free), &mut completion).err();
    completion
}

/// [`parse_completion`] of each text, in parallel.
pub fn parse_completions<S: AsRef<str> + Sync>(texts: &[S]) -> Vec<Completion<'_>> {
    texts.par_iter().map(|text| parse_completion(text.as_ref())).collect()
}

fn read_steps<'a>(scanner: &mut Scanner<'a>, completion: &mut Completion<'a>) -> Result<(), Malformed> {
    loop {
        scanner.space();
        if scanner.at_end() {
            return Ok(());
        }
        if scanner.literal(END) {
            completion.finished = true;
            return Ok(());
        }
        scanner.expect(ACTION, "`<ACTION>` or `<|endoftext|>`")?;
        scanner.space();
        let mut args = Vec::new();
        let name = scanner.atom(&mut args)?;
        completion.steps.push(Step { action: TextAtom { name, args }, state: None });
        let state = read_state(scanner)?;
        completion.steps.last_mut().expect("one was just pushed").state = state;
    }
}

fn read_state<'a>(scanner: &mut Scanner<'a>) -> Result<Option<Vec<TextAtom<'a>>>, Malformed> {
    scanner.space();
    if !scanner.literal(STATE) {
        return Ok(None);
    }
    scanner.space();
    scanner.atoms().map(Some)
}
