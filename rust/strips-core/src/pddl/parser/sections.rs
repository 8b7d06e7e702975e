//! The frame that domains and problems share: `(define (kind name) (:section …) …)`.

use super::super::edit_distance::nearest;
use super::super::error::{Declaration, Fault, PddlErrorKind};
use super::super::tree::{Item, Items, Tree};

/// What a keyword at the head of a section means to a reader of domains or problems.
pub(super) enum Standing {
    /// Belongs here, at most once.
    Once,
    /// Belongs here, any number of times.
    Many,
    /// Real PDDL, but outside what is supported: the feature's name in the plural.
    Unsupported(&'static str),
}

/// The name in `(define (kind name) …)` and the sections after it, each checked to belong here and not to repeat.
pub(super) struct Sections<'t> {
    pub(super) name: &'t str,
    parts: Vec<(&'t str, Item<'t>)>,
    end: crate::span::Span,
}

impl<'t> Sections<'t> {
    pub(super) fn read(
        tree: &'t Tree,
        kind: &'static str,
        known: &[&'static str],
        standing: fn(&str) -> Option<Standing>,
    ) -> Result<Self, Fault> {
        let mut items = tree.root().list("`(define …)`")?;
        let end = items.closing();
        keyword(&mut items, "define", "`define`")?;
        let name = header(&mut items, kind)?;
        let sections = items.map(|item| Ok((head(item)?, item))).collect::<Result<Vec<_>, Fault>>()?;
        check(&sections, known, standing)?;
        Ok(Self { name, parts: sections, end })
    }

    /// The content of the section with this keyword, if it is there.
    pub(super) fn get(&self, keyword: &str) -> Option<Items<'t>> {
        self.all(keyword).next()
    }

    /// The content of the section with this keyword, or an error that it is missing.
    pub(super) fn require(&self, keyword: &'static str) -> Result<Items<'t>, Fault> {
        let missing = || Fault::new(PddlErrorKind::Missing { section: keyword }, self.end);
        self.get(keyword).ok_or_else(missing)
    }

    /// The contents of every section with this keyword, in order.
    pub(super) fn all<'s>(&'s self, keyword: &'s str) -> impl Iterator<Item = Items<'t>> + 's {
        let matching = self.parts.iter().filter(move |(head, _)| *head == keyword);
        matching.map(|(_, item)| content(*item))
    }

    /// Every section with this keyword, in order.
    pub(super) fn items<'s>(&'s self, keyword: &'s str) -> impl Iterator<Item = Item<'t>> + 's {
        self.parts.iter().filter(move |(head, _)| *head == keyword).map(|&(_, item)| item)
    }
}

/// What follows the keyword in a section.
pub(super) fn content(section: Item<'_>) -> Items<'_> {
    let mut items = section.list("a section").expect("every section was checked to be a list");
    items.next();
    items
}

fn keyword(items: &mut Items<'_>, wanted: &str, expected: &'static str) -> Result<(), Fault> {
    let item = items.expect(expected)?;
    if item.as_name() == Some(wanted) { Ok(()) } else { Err(item.unexpected(expected)) }
}

fn header<'t>(items: &mut Items<'t>, kind: &'static str) -> Result<&'t str, Fault> {
    let expected = if kind == "domain" { "`(domain …)`" } else { "`(problem …)`" };
    let mut header = items.expect(expected)?.list(expected)?;
    keyword(&mut header, kind, expected)?;
    let name = header.expect("a name")?.name("a name")?;
    header.expect_end()?;
    Ok(name)
}

fn head(item: Item<'_>) -> Result<&str, Fault> {
    let expected = "a section such as `(:action …)`";
    let head = item.list(expected)?.expect(expected)?;
    let keyword = head.name(expected)?;
    if keyword.starts_with(':') { Ok(keyword) } else { Err(head.unexpected(expected)) }
}

fn check(
    sections: &[(&str, Item)],
    known: &[&'static str],
    standing: fn(&str) -> Option<Standing>,
) -> Result<(), Fault> {
    let mut seen: Vec<&str> = Vec::new();
    for &(keyword, item) in sections {
        let at = item.list("a section")?.expect("a keyword")?.span();
        match standing(keyword) {
            Some(Standing::Many) => {}
            Some(Standing::Once) if !seen.contains(&keyword) => seen.push(keyword),
            Some(Standing::Once) => return Err(Fault::duplicate(Declaration::Section, keyword, at)),
            Some(Standing::Unsupported(feature)) => return Err(Fault::unsupported(feature, at)),
            None => {
                let suggestion = nearest(keyword, known.iter().copied());
                let name = keyword.to_owned();
                let kind = PddlErrorKind::Undeclared { what: Declaration::Section, name, suggestion };
                return Err(Fault::new(kind, at));
            }
        }
    }
    Ok(())
}
