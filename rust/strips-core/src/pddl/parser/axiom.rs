//! `(:derived (p ?x …) condition)`.

use super::super::ast::{Axiom, Parameter, PredicateId};
use super::super::error::{Fault, PddlErrorKind};
use super::super::lookup::is_subtype;
use super::super::tree::{Item, Items};
use super::names::{Names, bind, type_text, variables};
use super::requirements::Feature;
use super::sections::content;

impl<'a> Names<'a> {
    /// Marks the head's predicate as derived, so that actions read later cannot set it.
    pub(super) fn note_derived(&mut self, section: Item<'a>) -> Result<(), Fault> {
        let mut head = content(section).expect("an atom")?.list("an atom in parentheses")?;
        let predicate = self.predicate(head.expect("a predicate")?)?;
        self.predicates[predicate.index()].derived = true;
        self.uses.note(Feature::DerivedPredicates, section.span());
        Ok(())
    }

    /// Reads a rule; a head parameter without a type takes the predicate's.
    pub(super) fn axiom(&mut self, section: Item<'a>) -> Result<Axiom, Fault> {
        let mut items = content(section);
        let whole = items.expect("an atom")?;
        let mut head = whole.list("an atom in parentheses")?;
        let predicate = self.predicate(head.expect("a predicate")?)?;
        let parameters = self.head_parameters(predicate, whole, &head)?;
        let mut scope = Vec::new();
        bind(&parameters, &variables(head), &mut scope);
        let condition = self.condition(items.expect("a condition")?, &mut scope)?;
        items.expect_end()?;
        Ok(Axiom { predicate, parameters, condition, span: section.span() })
    }

    fn head_parameters(
        &mut self,
        predicate: PredicateId,
        whole: Item<'a>,
        items: &Items<'a>,
    ) -> Result<Vec<Parameter>, Fault> {
        let typed = items.clone().any(|item| item.as_name().is_some());
        let mut parameters = self.parameters(items.clone())?;
        let declared = &self.predicates[predicate.index()];
        let (expected, found) = (declared.parameters.len(), parameters.len());
        if expected != found {
            let kind = PddlErrorKind::Arity { name: declared.name.clone(), expected, found };
            return Err(Fault::new(kind, whole.span()));
        }
        for (parameter, wanted) in parameters.iter_mut().zip(&declared.parameters) {
            if !typed {
                parameter.types.clone_from(&wanted.types);
            }
            self.check_head_type(&declared.name, parameter, wanted)?;
        }
        Ok(parameters)
    }

    fn check_head_type(&self, name: &str, parameter: &Parameter, wanted: &Parameter) -> Result<(), Fault> {
        let fits = |&sub| wanted.types.iter().any(|&sup| is_subtype(&self.types, sub, sup));
        if parameter.types.iter().all(fits) {
            return Ok(());
        }
        let kind = PddlErrorKind::WrongType {
            term: format!("?{}", parameter.name),
            found: type_text(&self.types, &parameter.types),
            name: format!("`{name}`"),
            wanted: type_text(&self.types, &wanted.types),
        };
        Err(Fault::new(kind, parameter.span))
    }
}
