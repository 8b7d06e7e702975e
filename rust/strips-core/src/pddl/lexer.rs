//! Tokens of PDDL: parentheses, names and variables. Knows no grammar.
//!
//! A `?` begins a variable even when it is glued to the word before it, as in `(aircraft?a)`. A comment runs from `;` to
//! the end of the line.

use super::error::{Fault, PddlErrorKind};
use crate::span::Span;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    Open,
    Close,
    Name,
    /// A variable; its span includes the question mark.
    Variable,
}

/// The tokens of a text, in order.
pub(super) struct Lexer<'s> {
    text: &'s str,
    at: usize,
}

impl<'s> Lexer<'s> {
    pub(super) fn new(text: &'s str) -> Self {
        Self { text, at: 0 }
    }

    /// The next token, or none at the end.
    pub(super) fn next_token(&mut self) -> Result<Option<(TokenKind, Span)>, Fault> {
        self.skip_blank();
        let start = self.at;
        let kind = match self.text.as_bytes().get(start) {
            None => return Ok(None),
            Some(b'(') => TokenKind::Open,
            Some(b')') => TokenKind::Close,
            Some(b'?') => TokenKind::Variable,
            Some(_) => TokenKind::Name,
        };
        self.at = start + usize::from(kind != TokenKind::Name);
        if matches!(kind, TokenKind::Name | TokenKind::Variable) {
            self.skip_word();
        }
        self.refuse_empty_word(start, kind)?;
        Ok(Some((kind, Span::new(start, self.at))))
    }

    fn skip_blank(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b' ' | b'\t' | b'\n' | b'\r' | 0x0B | 0x0C => self.at += 1,
                b';' => {
                    let rest = &bytes[self.at..];
                    self.at += rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
                }
                _ => break,
            }
        }
    }

    fn skip_word(&mut self) {
        let bytes = self.text.as_bytes();
        while bytes.get(self.at).is_some_and(|&byte| IS_WORD[usize::from(byte)]) {
            self.at += 1;
        }
    }

    fn refuse_empty_word(&self, start: usize, kind: TokenKind) -> Result<(), Fault> {
        let character = || self.text[self.at..].chars().next();
        match kind {
            TokenKind::Name if self.at == start => {
                let character = character().expect("a token starts at a character");
                let end = start + character.len_utf8();
                Err(Fault::new(PddlErrorKind::Character { character }, Span::new(start, end)))
            }
            TokenKind::Variable if self.at == start + 1 => {
                Err(Fault::expected("a variable's name after `?`", "nothing", Span::new(start, self.at)))
            }
            _ => Ok(()),
        }
    }
}

/// The bytes that words are made of: ASCII that prints, less `( ) ; ? , " { }`, and everything beyond ASCII.
const IS_WORD: [bool; 256] = {
    let mut table = [false; 256];
    let mut byte = 0;
    while byte < 256 {
        let plain = byte as u8;
        let special = matches!(plain, b'(' | b')' | b';' | b'?' | b',' | b'"' | b'{' | b'}');
        table[byte] = (plain.is_ascii_graphic() && !special) || byte >= 128;
        byte += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        let mut lexer = Lexer::new(text);
        let next =
            || lexer.next_token().expect("these texts are right").map(|(_, span)| &text[span.start()..span.end()]);
        std::iter::from_fn(next).collect()
    }

    #[test]
    fn a_variable_may_be_glued_to_the_word_before_it() {
        assert_eq!(words("(aircraft?a)"), ["(", "aircraft", "?a", ")"]);
    }

    #[test]
    fn comments_end_with_any_line_end() {
        assert_eq!(words("a;x\nb;y\rc;z\r\nd;"), ["a", "b", "c", "d"]);
    }

    #[test]
    fn what_is_no_word_is_refused_where_it_stands() {
        let mut lexer = Lexer::new("  \0");
        let fault = lexer.next_token().expect_err("a NUL byte is no token");
        assert_eq!((fault.kind, fault.span.start()), (PddlErrorKind::Character { character: '\0' }, 2));
        assert!(Lexer::new("? x").next_token().is_err());
    }
}
