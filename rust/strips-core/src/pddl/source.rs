//! A named text, and where its lines are. Knows bytes and lines; knows no PDDL.

use super::error::{PddlError, PddlErrorKind};
use crate::span::Span;

/// A PDDL text and the name to call it by in messages, usually its path.
///
/// ```
/// use strips_core::pddl::Source;
/// let source = Source::from_bytes("d.pddl", b"\xef\xbb\xbf(define)".to_vec())?;
/// assert_eq!(source.text(), "(define)", "the byte-order mark is no part of the text");
/// # Ok::<(), strips_core::pddl::PddlError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    name: String,
    text: String,
}

impl Source {
    /// The text under the name, less a leading byte-order mark.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if text.starts_with('\u{feff}') {
            text.drain(..'\u{feff}'.len_utf8());
        }
        Self { name: name.into(), text }
    }

    /// The bytes as a text.
    ///
    /// # Errors
    /// [`PddlErrorKind::NotUtf8`], at the first byte that is not UTF-8; UTF-16 is told apart by its byte-order mark.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<Self, PddlError> {
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self::new(name, text)),
            Err(error) => Err(not_utf8(name.into(), &error)),
        }
    }

    /// What messages call the text.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text itself.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Line and column of a byte offset, both from 1; columns count characters. Linear in the offset.
    pub fn position(&self, offset: usize) -> (usize, usize) {
        let before = &self.text[..offset];
        let start = before.rfind(['\n', '\r']).map_or(0, |at| at + 1);
        (line_number(before), before[start..].chars().count() + 1)
    }

    /// The line that holds the byte offset, without its end.
    pub fn line_at(&self, offset: usize) -> &str {
        let start = self.text[..offset].rfind(['\n', '\r']).map_or(0, |at| at + 1);
        let rest = &self.text[start..];
        &rest[..rest.find(['\n', '\r']).unwrap_or(rest.len())]
    }
}

/// The number of the line that follows `before`; `\n`, `\r\n` and a lone `\r` each end a line.
fn line_number(before: &str) -> usize {
    let bytes = before.as_bytes();
    let ends = |(at, &byte): (usize, &u8)| byte == b'\n' || (byte == b'\r' && bytes.get(at + 1) != Some(&b'\n'));
    1 + bytes.iter().enumerate().filter(|&pair| ends(pair)).count()
}

fn not_utf8(name: String, error: &std::string::FromUtf8Error) -> PddlError {
    let bytes = error.as_bytes();
    let utf16 = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    let good = error.utf8_error().valid_up_to();
    let readable = String::from_utf8_lossy(&bytes[..good]).into_owned();
    PddlError::new(PddlErrorKind::NotUtf8 { utf16 }, Span::new(good, good), &Source { name, text: readable })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_line_end_ends_one_line() {
        let source = Source::new("x", "a\r\nb\rc\nd");
        let lines: Vec<_> = [0, 3, 5, 7].map(|offset| source.position(offset)).to_vec();
        assert_eq!(lines, [(1, 1), (2, 1), (3, 1), (4, 1)]);
        assert_eq!(source.line_at(3), "b");
    }

    #[test]
    fn columns_count_characters() {
        assert_eq!(Source::new("x", "äö x").position(5), (1, 4));
    }
}
