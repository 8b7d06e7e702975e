//! Prompts: what a model is given.

use rayon::prelude::*;

use super::scan::{Malformed, Scanner, Spacing, TextAtom};
use super::{ACTION, END, GOAL, INIT, OBJECTS, START, VOCAB};

/// A prompt's segments.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Prompt<'a> {
    /// The objects in order of declaration, if the prompt names them.
    pub objects: Option<Vec<TypedName<'a>>>,
    /// Pairs of a name and the word for it, if the prompt gives them: all actions, then perhaps all predicates.
    pub vocab: Option<Vec<(&'a str, &'a str)>>,
    /// The goal's literals; the flag is false for `not …`.
    pub goal: Vec<(TextAtom<'a>, bool)>,
    /// The atoms of the initial state.
    pub init: Vec<TextAtom<'a>>,
}

/// An object's name and its type, or its types joined by `/`.
pub type TypedName<'a> = (&'a str, &'a str);

/// Reads a prompt. White space may be anything.
///
/// # Errors
/// [`Malformed`] where the text is no prompt, or something follows it.
///
/// ```
/// use strips_core::text::parse_prompt;
/// let prompt = parse_prompt("<|startoftext|> <GOAL> on(cup, shelf) <INIT> inhand(cup)").unwrap();
/// assert_eq!(prompt.goal[0].0.args, ["cup", "shelf"]);
/// ```
pub fn parse_prompt(text: &str) -> Result<Prompt<'_>, Malformed> {
    let mut scanner = Scanner::new(text, Spacing::Free);
    let mut prompt = Prompt::default();
    scanner.space();
    marker(&mut scanner, START, "`<|startoftext|>`")?;
    prompt.objects = optional(&mut scanner, OBJECTS)?;
    prompt.vocab = optional(&mut scanner, VOCAB)?;
    marker(&mut scanner, GOAL, "`<GOAL>`")?;
    prompt.goal = literals(&mut scanner)?;
    scanner.space();
    marker(&mut scanner, INIT, "`<INIT>`")?;
    prompt.init = scanner.atoms()?;
    scanner.space();
    if scanner.at_end() { Ok(prompt) } else { Err(scanner.malformed("the end of the prompt")) }
}

/// [`parse_prompt`] of each text, in parallel.
pub fn parse_prompts<S: AsRef<str> + Sync>(texts: &[S]) -> Vec<Result<Prompt<'_>, Malformed>> {
    texts.par_iter().map(|text| parse_prompt(text.as_ref())).collect()
}

/// Parts a text into prompt and completion, without the space between them; the latter is empty where there is none.
///
/// ```
/// use strips_core::text::split_text;
/// assert_eq!(split_text("<|startoftext|> <GOAL> <INIT> <|endoftext|>"), ("<|startoftext|> <GOAL> <INIT>", "<|endoftext|>"));
/// ```
pub fn split_text(text: &str) -> (&str, &str) {
    let starts = [text.find(ACTION), text.find(END)];
    match starts.into_iter().flatten().min() {
        Some(start) => (text[..start].strip_suffix(' ').unwrap_or(&text[..start]), &text[start..]),
        None => (text, ""),
    }
}

fn marker(scanner: &mut Scanner<'_>, marker: &str, expected: &'static str) -> Result<(), Malformed> {
    scanner.expect(marker, expected)?;
    scanner.space();
    Ok(())
}

/// The pairs after `marker`, if that comes next.
fn optional<'a>(scanner: &mut Scanner<'a>, marker: &str) -> Result<Option<Vec<(&'a str, &'a str)>>, Malformed> {
    if !scanner.literal(marker) {
        return Ok(None);
    }
    scanner.space();
    let pairs = pairs(scanner)?;
    scanner.space();
    Ok(Some(pairs))
}

/// A list of `name word`.
pub(crate) fn pairs<'a>(scanner: &mut Scanner<'a>) -> Result<Vec<(&'a str, &'a str)>, Malformed> {
    let mut pairs = Vec::new();
    scanner.list(|scanner| {
        let first = scanner.name().ok_or_else(|| scanner.malformed("a name"))?;
        scanner.space();
        let second = scanner.name().ok_or_else(|| scanner.malformed("a type or word"))?;
        pairs.push((first, second));
        Ok(())
    })?;
    Ok(pairs)
}

/// A list of atoms, each with or without `not` before it.
fn literals<'a>(scanner: &mut Scanner<'a>) -> Result<Vec<(TextAtom<'a>, bool)>, Malformed> {
    let mut literals = Vec::new();
    scanner.list(|scanner| {
        let (mut args, positive) = (Vec::new(), !scanner.literal("not "));
        let name = scanner.atom(&mut args)?;
        literals.push((TextAtom { name, args }, positive));
        Ok(())
    })?;
    Ok(literals)
}
