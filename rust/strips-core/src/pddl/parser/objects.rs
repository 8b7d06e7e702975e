//! Constants and objects: typed lists of names, which may repeat only without contradiction.

use super::super::ast::{Object, ObjectId, TypeId, Warning};
use super::super::error::{Declaration, Fault};
use super::super::tree::{Item, Items};
use super::names::Names;
use super::typed_list::groups;

impl<'a> Names<'a> {
    /// Declares each name of a typed list. A name already declared with the same type is kept, with a warning; with
    /// another type it is an error. A pending object (one without types) takes its type here.
    pub(super) fn declare_objects(&mut self, items: Items<'a>) -> Result<(), Fault> {
        let (groups, warnings) = groups(items)?;
        self.warnings.extend(warnings);
        for group in groups {
            let types = self.resolve_types(&group.types)?;
            group.members.into_iter().try_for_each(|item| self.declare_object(item, &types))?;
        }
        Ok(())
    }

    fn declare_object(&mut self, item: Item<'a>, types: &[TypeId]) -> Result<(), Fault> {
        let name = item.name("an object's name")?;
        let next = ObjectId::from(self.objects.len());
        let id = *self.object_ids.entry(name).or_insert(next);
        if id == next {
            self.objects.push(Object { name: name.to_owned(), types: types.to_vec(), span: item.span() });
            return Ok(());
        }
        let known = &mut self.objects[id.index()];
        if known.types.is_empty() {
            known.types = types.to_vec();
            known.span = item.span();
        } else if known.types == types {
            let message = format!("object `{name}` is declared twice, with the same type");
            self.warnings.push(Warning { message, span: item.span() });
        } else {
            return Err(Fault::duplicate(Declaration::Object, name, item.span()));
        }
        Ok(())
    }
}
