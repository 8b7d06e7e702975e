//! The `:types` section: a hierarchy with `object` at its root, several parents allowed, cycles refused.

use rustc_hash::FxHashMap;

use super::super::ast::{Type, TypeId, Warning};
use super::super::error::{Fault, PddlErrorKind};
use super::super::tree::Items;
use super::typed_list::{Group, groups};
use crate::span::Span;

/// The types under construction.
pub(super) struct Types<'t> {
    pub(super) list: Vec<Type>,
    pub(super) ids: FxHashMap<&'t str, TypeId>,
    pub(super) warnings: Vec<Warning>,
}

impl<'t> Types<'t> {
    /// Reads the section; without one, `object` is the only type.
    ///
    /// A name that stands only as a parent is taken as declared, with a warning, as other readers do.
    pub(super) fn read(section: Option<Items<'t>>) -> Result<Self, Fault> {
        let root = Type { name: "object".to_owned(), parents: Vec::new(), span: Span::default() };
        let mut types = Self { list: vec![root], ids: FxHashMap::default(), warnings: Vec::new() };
        types.ids.insert("object", TypeId::OBJECT);
        let (groups, warnings) = section.map_or(Ok((Vec::new(), Vec::new())), groups)?;
        types.warnings.extend(warnings);
        types.declare_members(&groups)?;
        types.declare_parents(&groups);
        types.link(&groups);
        types.refuse_cycles()?;
        Ok(types)
    }

    fn declare_members(&mut self, groups: &[Group<'t>]) -> Result<(), Fault> {
        for &item in groups.iter().flat_map(|group| &group.members) {
            self.declare(item.name("a type")?, item.span());
        }
        Ok(())
    }

    fn declare_parents(&mut self, groups: &[Group<'t>]) {
        for &(name, span) in groups.iter().flat_map(|group| &group.types) {
            if !self.ids.contains_key(name) {
                let message = format!("type `{name}` is used as a supertype but not declared");
                self.warnings.push(Warning { message, span });
                self.declare(name, span);
            }
        }
    }

    fn declare(&mut self, name: &'t str, span: Span) {
        let next = TypeId::from(self.list.len());
        let id = *self.ids.entry(name).or_insert(next);
        if id == TypeId::OBJECT {
            self.list[0].span = span;
        } else if id == next {
            self.list.push(Type { name: name.to_owned(), parents: Vec::new(), span });
        }
    }

    /// Enters the parents as written; a type declared several times has them all.
    fn link(&mut self, groups: &[Group<'t>]) {
        for group in groups {
            for item in &group.members {
                let id = self.ids[item.text()];
                for (parent, _) in &group.types {
                    let parent = self.ids[parent];
                    let both_root = id == TypeId::OBJECT && parent == TypeId::OBJECT;
                    let parents = &mut self.list[id.index()].parents;
                    if !both_root && !parents.contains(&parent) {
                        parents.push(parent);
                    }
                }
            }
        }
        let orphans = self.list.iter_mut().skip(1).filter(|kind| kind.parents.is_empty());
        orphans.for_each(|kind| kind.parents.push(TypeId::OBJECT));
    }

    /// Kahn's algorithm: removing types without parents again and again removes all of them unless there is a cycle.
    fn refuse_cycles(&self) -> Result<(), Fault> {
        let mut missing: Vec<usize> = self.list.iter().map(|kind| kind.parents.len()).collect();
        let mut children = vec![Vec::new(); self.list.len()];
        for (child, kind) in self.list.iter().enumerate() {
            kind.parents.iter().for_each(|parent| children[parent.index()].push(child));
        }
        let mut free: Vec<usize> = (0..missing.len()).filter(|&id| missing[id] == 0).collect();
        while let Some(id) = free.pop() {
            for &child in &children[id] {
                missing[child] -= 1;
                if missing[child] == 0 {
                    free.push(child);
                }
            }
        }
        let cyclic = self.list.iter().zip(&missing).find(|&(_, &missing)| missing > 0);
        cyclic.map_or(Ok(()), |(kind, _)| {
            Err(Fault::new(PddlErrorKind::CyclicType { name: kind.name.clone() }, kind.span))
        })
    }
}
