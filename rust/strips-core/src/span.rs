//! Where something stands in a source text. Knows bytes, lines and columns; knows no PDDL.

use std::fmt;

/// A half-open range of byte offsets into one source text.
///
/// Equality of syntax trees should not depend on where they were written, so every `Span` equals every other one.
///
/// ```
/// use strips_core::span::Span;
/// let span = Span::new(3, 7);
/// assert_eq!((span.start(), span.end()), (3, 7));
/// assert_eq!(span, Span::default(), "spans carry no meaning of their own");
/// ```
#[derive(Clone, Copy, Default)]
pub struct Span {
    start: u32,
    end: u32,
}

impl Span {
    /// The span of the bytes `start..end`.
    pub fn new(start: usize, end: usize) -> Self {
        Self { start: start as u32, end: end as u32 }
    }

    /// Offset of the first byte.
    pub fn start(self) -> usize {
        self.start as usize
    }

    /// Offset one past the last byte.
    pub fn end(self) -> usize {
        self.end as usize
    }
}

impl PartialEq for Span {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for Span {}

impl std::hash::Hash for Span {
    fn hash<H: std::hash::Hasher>(&self, _: &mut H) {}
}

impl fmt::Debug for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.start, self.end)
    }
}
