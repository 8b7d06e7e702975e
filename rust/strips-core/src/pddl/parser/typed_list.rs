//! Typed lists: `a b - t c - (either t u) d`.

use super::super::ast::Warning;
use super::super::error::Fault;
use super::super::tree::{Item, Items, NodeKind};
use crate::span::Span;

/// Members that share one type.
pub(super) struct Group<'t> {
    /// The names or variables, in order.
    pub(super) members: Vec<Item<'t>>,
    /// The types' names and places; none where no type is written.
    pub(super) types: Vec<(&'t str, Span)>,
}

/// The groups of a typed list, and a warning for each `-type` written without a space.
pub(super) fn groups(mut items: Items<'_>) -> Result<(Vec<Group<'_>>, Vec<Warning>), Fault> {
    let (mut groups, mut warnings, mut members) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(item) = items.next() {
        let types = match item.as_name() {
            Some("-") => type_names(items.expect("a type")?)?,
            Some(name) if name.starts_with('-') && !members.is_empty() => {
                warnings
                    .push(Warning { message: format!("`{name}` is read as `- {}`", &name[1..]), span: item.span() });
                vec![(&name[1..], Span::new(item.span().start() + 1, item.span().end()))]
            }
            _ => {
                members.push(item);
                continue;
            }
        };
        if members.is_empty() {
            return Err(Fault::expected("a name before the type", "`-`", item.span()));
        }
        groups.push(Group { members: std::mem::take(&mut members), types });
    }
    if !members.is_empty() {
        groups.push(Group { members, types: Vec::new() });
    }
    Ok((groups, warnings))
}

/// The names in `t` or `(either t u …)`.
fn type_names(item: Item<'_>) -> Result<Vec<(&str, Span)>, Fault> {
    if item.kind() != NodeKind::List {
        return Ok(vec![(item.name("a type")?, item.span())]);
    }
    let mut items = item.list("a type")?;
    let head = items.expect("`either`")?;
    if head.as_name() != Some("either") {
        return Err(head.unexpected("`either`"));
    }
    let first = items.expect("a type")?;
    std::iter::once(first).chain(items).map(|item| Ok((item.name("a type")?, item.span()))).collect()
}
