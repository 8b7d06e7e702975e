//! The tree of parentheses, before any word has a meaning.
//!
//! Nodes lie in one array in the order of the text, each list knowing where its last descendant ends: no recursion to
//! build, walk or drop. Depth is capped, so that everything after may recurse. 16 bytes a token, linear time.

use super::error::{Fault, PddlErrorKind};
use super::lexer::{Lexer, TokenKind};
use crate::span::Span;

/// Lists nested deeper than this are refused.
pub(crate) const MAX_DEPTH: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeKind {
    List,
    Name,
    Variable,
}

struct Node {
    span: Span,
    /// One past the last node of this subtree.
    end: u32,
    kind: NodeKind,
}

/// A whole text as nested lists of words, in lower case.
pub(crate) struct Tree {
    text: String,
    nodes: Vec<Node>,
}

impl Tree {
    /// Reads exactly one list, the definition, from the text.
    pub(crate) fn read(text: &str) -> Result<Tree, Fault> {
        if u32::try_from(text.len()).is_err() {
            return Err(Fault::new(PddlErrorKind::TooLarge, Span::default()));
        }
        let nodes = Reader::new(text).read()?;
        Ok(Tree { text: text.to_ascii_lowercase(), nodes })
    }

    /// The one list that the text consists of.
    pub(crate) fn root(&self) -> Item<'_> {
        Item { tree: self, index: 0 }
    }
}

struct Reader<'s> {
    text: &'s str,
    nodes: Vec<Node>,
    open: Vec<u32>,
    /// Where a section first began inside another: a `)` is missing before it.
    suspect: Option<Span>,
}

impl<'s> Reader<'s> {
    fn new(text: &'s str) -> Self {
        Self { text, nodes: Vec::new(), open: Vec::new(), suspect: None }
    }

    fn read(mut self) -> Result<Vec<Node>, Fault> {
        let mut lexer = Lexer::new(self.text);
        while let Some((kind, span)) = lexer.next_token()? {
            match kind {
                TokenKind::Open => self.open(span)?,
                TokenKind::Close => self.close(span)?,
                TokenKind::Name => self.word(NodeKind::Name, span)?,
                TokenKind::Variable => self.word(NodeKind::Variable, span)?,
            }
        }
        self.finish()
    }

    fn open(&mut self, span: Span) -> Result<(), Fault> {
        self.refuse_trailing(span)?;
        if self.open.len() == MAX_DEPTH {
            return Err(Fault::new(PddlErrorKind::TooDeep { limit: MAX_DEPTH }, span));
        }
        self.open.push(self.nodes.len() as u32);
        self.push(NodeKind::List, span);
        Ok(())
    }

    fn close(&mut self, span: Span) -> Result<(), Fault> {
        let Some(index) = self.open.pop() else {
            return Err(Fault::new(PddlErrorKind::SurplusClose, span));
        };
        let end = self.nodes.len() as u32;
        let node = &mut self.nodes[index as usize];
        node.span = Span::new(node.span.start(), span.end());
        node.end = end;
        Ok(())
    }

    fn word(&mut self, kind: NodeKind, span: Span) -> Result<(), Fault> {
        self.refuse_trailing(span)?;
        if self.open.is_empty() {
            let word = &self.text[span.start()..span.end()];
            return Err(Fault::expected("`(define …)`", &format!("`{word}`"), span));
        }
        self.note_nested_section(span);
        self.push(kind, span);
        Ok(())
    }

    fn push(&mut self, kind: NodeKind, span: Span) {
        self.nodes.push(Node { span, end: self.nodes.len() as u32 + 1, kind });
    }

    fn refuse_trailing(&self, span: Span) -> Result<(), Fault> {
        let ended = self.open.is_empty() && !self.nodes.is_empty();
        if ended { Err(Fault::new(PddlErrorKind::Trailing, span)) } else { Ok(()) }
    }

    /// `(:word` more than one level deep means that the section before it was never closed.
    fn note_nested_section(&mut self, span: Span) {
        let first_in_list = self.open.last().is_some_and(|&list| list as usize + 1 == self.nodes.len());
        let nested = self.open.len() > 2 && first_in_list && self.text.as_bytes()[span.start()] == b':';
        if nested && self.suspect.is_none() {
            self.suspect = Some(span);
        }
    }

    fn finish(self) -> Result<Vec<Node>, Fault> {
        if let Some(&innermost) = self.open.last() {
            let unclosed = Fault::new(PddlErrorKind::Unclosed, self.nodes[innermost as usize].span);
            return Err(self.suspect.map_or(unclosed, |span| Fault::new(PddlErrorKind::UnclosedBefore, span)));
        }
        if self.nodes.is_empty() {
            return Err(Fault::new(PddlErrorKind::Empty, Span::default()));
        }
        Ok(self.nodes)
    }
}

/// One node: a list, a name or a variable.
#[derive(Clone, Copy)]
pub(crate) struct Item<'t> {
    tree: &'t Tree,
    index: u32,
}

impl<'t> Item<'t> {
    fn node(self) -> &'t Node {
        &self.tree.nodes[self.index as usize]
    }

    pub(crate) fn span(self) -> Span {
        self.node().span
    }

    pub(crate) fn kind(self) -> NodeKind {
        self.node().kind
    }

    /// The item's text in lower case, of a list with all that it holds.
    pub(crate) fn text(self) -> &'t str {
        &self.tree.text[self.span().start()..self.span().end()]
    }

    /// What to call the item in "expected …, found …".
    pub(crate) fn describe(self) -> String {
        match self.kind() {
            NodeKind::List => "a list".to_owned(),
            NodeKind::Name => format!("`{}`", self.text()),
            NodeKind::Variable => format!("the variable `{}`", self.text()),
        }
    }

    /// The list's items, or an error that something else was expected.
    pub(crate) fn list(self, expected: &'static str) -> Result<Items<'t>, Fault> {
        match self.kind() {
            NodeKind::List => {
                Ok(Items { tree: self.tree, next: self.index + 1, end: self.node().end, list: self.index })
            }
            _ => Err(self.unexpected(expected)),
        }
    }

    /// The name, or an error that something else was expected.
    pub(crate) fn name(self, expected: &'static str) -> Result<&'t str, Fault> {
        match self.kind() {
            NodeKind::Name => Ok(self.text()),
            _ => Err(self.unexpected(expected)),
        }
    }

    /// The name if it is one.
    pub(crate) fn as_name(self) -> Option<&'t str> {
        (self.kind() == NodeKind::Name).then(|| self.text())
    }

    /// The first word of the list, if it is a list that begins with a name.
    pub(crate) fn head(self) -> Option<&'t str> {
        self.list("").ok()?.next()?.as_name()
    }

    pub(crate) fn unexpected(self, expected: &'static str) -> Fault {
        Fault::expected(expected, &self.describe(), self.span())
    }
}

/// The items of one list, in order.
#[derive(Clone)]
pub(crate) struct Items<'t> {
    tree: &'t Tree,
    next: u32,
    end: u32,
    list: u32,
}

impl<'t> Items<'t> {
    /// The next item, or an error that the list ended too early.
    pub(crate) fn expect(&mut self, expected: &'static str) -> Result<Item<'t>, Fault> {
        self.next().ok_or_else(|| Fault::expected(expected, "`)`", self.closing()))
    }

    /// An error unless the list has ended.
    pub(crate) fn expect_end(&mut self) -> Result<(), Fault> {
        self.next().map_or(Ok(()), |item| Err(item.unexpected("`)`")))
    }

    /// Where the list's closing parenthesis stands.
    pub(crate) fn closing(&self) -> Span {
        let end = self.tree.nodes[self.list as usize].span.end();
        Span::new(end - 1, end)
    }
}

impl<'t> Iterator for Items<'t> {
    type Item = Item<'t>;

    fn next(&mut self) -> Option<Item<'t>> {
        (self.next < self.end).then(|| {
            let item = Item { tree: self.tree, index: self.next };
            self.next = item.node().end;
            item
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> (PddlErrorKind, usize) {
        let fault = Tree::read(text).err().expect("these texts are wrong");
        (fault.kind, fault.span.start())
    }

    #[test]
    fn nesting_beyond_the_cap_is_refused_early() {
        let (kind, at) = fault(&"(".repeat(1_000_000));
        assert_eq!((kind, at), (PddlErrorKind::TooDeep { limit: MAX_DEPTH }, MAX_DEPTH));
    }

    #[test]
    fn a_missing_parenthesis_is_reported_where_the_next_section_begins() {
        assert_eq!(fault("(define (:a (x) (y) (:b (z)))"), (PddlErrorKind::UnclosedBefore, 21));
        assert_eq!(fault("(define (a)"), (PddlErrorKind::Unclosed, 0));
    }

    #[test]
    fn surplus_parentheses_and_text_are_refused() {
        assert_eq!(fault("(a))"), (PddlErrorKind::SurplusClose, 3));
        assert_eq!(fault("(a) (b)"), (PddlErrorKind::Trailing, 4));
        assert_eq!(fault(" ; nothing\n").0, PddlErrorKind::Empty);
    }
}
