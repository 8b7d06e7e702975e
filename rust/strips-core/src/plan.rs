//! Plans as text: one step in parentheses after another, as in the planning competitions.
//!
//! Comments (`;` to the end of the line), blank lines, any case, CRLF, a byte-order mark, a time before a step
//! (`0.000:`) and a duration after it (`[1.0]`) are read; a step ends on the line it began on. Knows words and lines, and
//! not what they denote. Linear time, no allocation per step.

use std::fmt;

/// One step as written, without its parentheses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanStep<'t> {
    words: &'t str,
    /// The line that it stands on, from 1.
    pub line: usize,
}

impl<'t> PlanStep<'t> {
    /// The action's name, as written.
    pub fn name(self) -> &'t str {
        self.all_words().next().unwrap_or_default()
    }

    /// The arguments, as written.
    pub fn args(self) -> impl Iterator<Item = &'t str> + Clone {
        self.all_words().skip(1)
    }

    fn all_words(self) -> impl Iterator<Item = &'t str> + Clone {
        self.words.split_ascii_whitespace()
    }
}

impl fmt::Display for PlanStep<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.all_words().map(str::to_ascii_lowercase).collect();
        write!(f, "({})", words.join(" "))
    }
}

/// What makes a text no plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanSyntaxKind {
    /// Something other than a step in parentheses.
    #[error("expected a step in parentheses, found `{found}`")]
    ExpectedStep {
        /// The beginning of what stands there.
        found: String,
    },
    /// A step that does not end on its line.
    #[error("this step is never closed")]
    Unclosed,
    /// `()`.
    #[error("a step needs an action's name")]
    Empty,
    /// A character that no name may hold.
    #[error("unexpected character {character:?} in a step")]
    Character {
        /// The character.
        character: char,
    },
    /// Something other than `[number]` after a step.
    #[error("expected a duration such as `[1.0]`")]
    Duration,
}

/// A text that is no plan, and the line that shows it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {kind}")]
pub struct PlanSyntaxError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub kind: PlanSyntaxKind,
}

/// Reads a plan.
///
/// # Errors
/// At the first thing that is neither a step, a comment nor blank.
///
/// ```
/// use strips_core::plan::parse_plan;
/// let steps = parse_plan("; a plan\n0.0: (PICK cup) [1.0]\n(place cup shelf)\n")?;
/// assert_eq!((steps[0].to_string().as_str(), steps[0].line), ("(pick cup)", 2));
/// assert_eq!(parse_plan("pick cup").unwrap_err().line, 1);
/// # Ok::<(), strips_core::plan::PlanSyntaxError>(())
/// ```
pub fn parse_plan(text: &str) -> Result<Vec<PlanStep<'_>>, PlanSyntaxError> {
    let mut reader = PlanReader::new(text);
    let mut steps = Vec::new();
    while let Some(step) = reader.next_step()? {
        steps.push(step);
    }
    Ok(steps)
}

/// What stands for a plan without steps among many, so that it is a block like any other.
pub const EMPTY_PLAN: &str = "; empty plan\n";

/// Splits a text of many plans at its blank lines; a line that holds only a comment is not blank.
///
/// Gives each plan and the number of lines before it. Comments alone are no plan, but for [`EMPTY_PLAN`].
pub fn split_plans(text: &str) -> Vec<(usize, &str)> {
    let mut plans = Vec::new();
    let mut start: Option<(usize, usize)> = None;
    let mut at = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let blank = line.trim().is_empty();
        match start {
            Some((before, from)) if blank => {
                plans.push((before, &text[from..at]));
                start = None;
            }
            None if !blank => start = Some((number, at)),
            _ => {}
        }
        at += line.len();
    }
    plans.extend(start.map(|(before, from)| (before, &text[from..])));
    plans.retain(|(_, plan)| is_plan(plan));
    plans
}

fn is_plan(block: &str) -> bool {
    let says = |line: &str| !line.starts_with(';') || line == EMPTY_PLAN.trim_end();
    block.lines().any(|line| says(line.trim()))
}

struct PlanReader<'t> {
    text: &'t str,
    at: usize,
    line: usize,
}

impl<'t> PlanReader<'t> {
    fn new(text: &'t str) -> Self {
        Self { text: text.strip_prefix('\u{feff}').unwrap_or(text), at: 0, line: 1 }
    }

    fn next_step(&mut self) -> Result<Option<PlanStep<'t>>, PlanSyntaxError> {
        self.skip_blank();
        if self.peek().is_none() {
            return Ok(None);
        }
        self.skip_time();
        if self.peek() != Some(b'(') {
            return Err(self.error(PlanSyntaxKind::ExpectedStep { found: self.excerpt() }));
        }
        let step = self.step()?;
        self.skip_duration()?;
        Ok(Some(step))
    }

    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn error(&self, kind: PlanSyntaxKind) -> PlanSyntaxError {
        PlanSyntaxError { line: self.line, kind }
    }

    /// The rest of the line, up to a few words.
    fn excerpt(&self) -> String {
        let rest = &self.text[self.at..];
        let line = &rest[..rest.find(['\n', '\r']).unwrap_or(rest.len())];
        line.chars().take(40).map(|c| if c.is_control() { ' ' } else { c }).collect()
    }

    fn skip_blank(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'\r' => self.line += usize::from(bytes.get(self.at + 1) != Some(&b'\n')),
                b';' => {
                    self.at += bytes[self.at..]
                        .iter()
                        .position(|b| matches!(b, b'\n' | b'\r'))
                        .unwrap_or(bytes.len() - self.at);
                    continue;
                }
                b' ' | b'\t' | 0x0B | 0x0C => {}
                _ => break,
            }
            self.at += 1;
        }
    }

    fn skip_spaces(&mut self) {
        self.skip_while(|byte| matches!(byte, b' ' | b'\t'));
    }

    fn skip_while(&mut self, keep: impl Fn(u8) -> bool) {
        while self.peek().is_some_and(&keep) {
            self.at += 1;
        }
    }

    /// Skips `0.000:`; anything else is left where it stands.
    fn skip_time(&mut self) {
        let start = self.at;
        self.skip_while(in_number);
        let number = self.at > start;
        self.skip_spaces();
        if number && self.peek() == Some(b':') {
            self.at += 1;
            self.skip_spaces();
        } else {
            self.at = start;
        }
    }

    /// Reads `(word …)`.
    fn step(&mut self) -> Result<PlanStep<'t>, PlanSyntaxError> {
        let start = self.at + 1;
        let rest = &self.text[start..];
        let length = rest.find(|c| !in_step(c)).ok_or_else(|| self.error(PlanSyntaxKind::Unclosed))?;
        match rest[length..].chars().next() {
            Some(')') => {}
            Some(character) if !matches!(character, '\n' | '\r' | '(' | ';') => {
                return Err(self.error(PlanSyntaxKind::Character { character }));
            }
            _ => return Err(self.error(PlanSyntaxKind::Unclosed)),
        }
        let words = &rest[..length];
        if words.trim_ascii().is_empty() {
            return Err(self.error(PlanSyntaxKind::Empty));
        }
        self.at = start + length + 1;
        Ok(PlanStep { words, line: self.line })
    }

    /// Skips `[1.0]` where it stands.
    fn skip_duration(&mut self) -> Result<(), PlanSyntaxError> {
        self.skip_spaces();
        if self.peek() != Some(b'[') {
            return Ok(());
        }
        self.at += 1;
        self.skip_spaces();
        let start = self.at;
        self.skip_while(in_number);
        let number = self.at > start;
        self.skip_spaces();
        if !number || self.peek() != Some(b']') {
            return Err(self.error(PlanSyntaxKind::Duration));
        }
        self.at += 1;
        Ok(())
    }
}

fn in_number(byte: u8) -> bool {
    byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E' | b'+' | b'-')
}

/// What may stand between a step's parentheses: blanks, and what PDDL allows in names.
fn in_step(character: char) -> bool {
    match character {
        ' ' | '\t' => true,
        '(' | ')' | ';' | '?' | ',' | '"' | '{' | '}' => false,
        _ => character.is_ascii_graphic() || !character.is_ascii(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(String, usize)> {
        parse_plan(text).expect("these are plans").iter().map(|step| (step.to_string(), step.line)).collect()
    }

    fn wrong(text: &str) -> (usize, PlanSyntaxKind) {
        let error = parse_plan(text).expect_err("these are no plans");
        (error.line, error.kind)
    }

    #[test]
    fn whatever_planners_print_around_steps_is_read() {
        let text = "\u{feff}; head\r\n\r\n 0.000 : ( A  b ) [ 1.5 ] ; tail (\r\n(c)(d)\r\n";
        let expected = [("(a b)", 3), ("(c)", 4), ("(d)", 4)].map(|(step, line)| (step.to_owned(), line));
        assert_eq!(lines(text), expected);
        assert!(lines("").is_empty());
    }

    #[test]
    fn what_is_no_step_is_refused_at_its_line() {
        assert_eq!(wrong("(a)\n(b c\n(d)"), (2, PlanSyntaxKind::Unclosed));
        assert_eq!(wrong("(a)\n(b))").0, 2);
        assert_eq!(wrong("(a)\n\nmove(b, c)").0, 3);
        assert_eq!(wrong("(move, b)"), (1, PlanSyntaxKind::Character { character: ',' }));
        assert_eq!(wrong("( )"), (1, PlanSyntaxKind::Empty));
        assert_eq!(wrong("(a) [x]"), (1, PlanSyntaxKind::Duration));
        assert_eq!(wrong("3 (a)").0, 1);
    }

    #[test]
    fn blank_lines_split_many_plans() {
        let plans = split_plans("\n(a)\n(b)\n\n \n; c\n(d)");
        assert_eq!(plans, [(1, "(a)\n(b)\n"), (5, "; c\n(d)")]);
    }

    #[test]
    fn comments_alone_are_no_plan_but_for_the_empty_one() {
        let text = format!("; notes\n\n{EMPTY_PLAN}\n(a)\n");
        assert_eq!(split_plans(&text), [(2, EMPTY_PLAN), (4, "(a)\n")]);
    }
}
