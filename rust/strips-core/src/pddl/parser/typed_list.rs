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
            Some(name) if name.starts_with('-') => {
                let message = format!("`{name}` is read as `- {}`", &name[1..]);
                warnings.push(Warning { message, span: item.span() });
                vec![glued_type(item, name)?]
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
        return Ok(vec![type_name(item)?]);
    }
    let mut items = item.list("a type")?;
    let head = items.expect("`either`")?;
    if head.as_name() != Some("either") {
        return Err(head.unexpected("`either`"));
    }
    let first = items.expect("a type")?;
    std::iter::once(first).chain(items).map(type_name).collect()
}

/// The type in `-type`.
fn glued_type<'t>(item: Item<'t>, name: &'t str) -> Result<(&'t str, Span), Fault> {
    match name.strip_prefix('-') {
        Some(kind) if !kind.starts_with('-') => Ok((kind, Span::new(item.span().start() + 1, item.span().end()))),
        _ => Err(item.unexpected("a type after one `-`")),
    }
}

/// The name of a type, which must not begin with `-`.
fn type_name(item: Item<'_>) -> Result<(&str, Span), Fault> {
    let name = item.name("a type")?;
    if name.starts_with('-') { Err(item.unexpected("a type")) } else { Ok((name, item.span())) }
}
