//! Conditions: preconditions, goals, and the conditions of effects and axioms.

use super::super::ast::{Condition, TypeId};
use super::super::error::{Fault, PddlErrorKind};
use super::super::tree::{Item, Items, NodeKind};
use super::names::{Names, Variables, bind, variables};
use super::requirements::Feature;
use crate::span::Span;

/// What trajectory constraints, preferences and durative conditions begin with.
const OUTSIDE: [(&str, &str); 17] = [
    ("preference", "preferences"),
    ("always", "trajectory constraints"),
    ("sometime", "trajectory constraints"),
    ("within", "trajectory constraints"),
    ("at-most-once", "trajectory constraints"),
    ("sometime-after", "trajectory constraints"),
    ("sometime-before", "trajectory constraints"),
    ("always-within", "trajectory constraints"),
    ("hold-during", "trajectory constraints"),
    ("hold-after", "trajectory constraints"),
    ("<", NUMERIC),
    ("<=", NUMERIC),
    (">", NUMERIC),
    (">=", NUMERIC),
    ("over", "durative conditions"),
    ("knows", "conditions on knowledge"),
    ("uncertain", "conditions on knowledge"),
];

/// The name under which numeric fluents are refused.
pub(super) const NUMERIC: &str = "numeric fluents other than action costs";

impl<'a> Names<'a> {
    /// Reads a condition; `()` is true.
    pub(super) fn condition(&mut self, item: Item<'a>, scope: &mut Variables<'a>) -> Result<Condition, Fault> {
        let mut items = item.list("a condition in parentheses")?;
        let Some(head) = items.next() else { return Ok(Condition::And(Vec::new())) };
        match head.name("a predicate or connective")? {
            "and" => self.conditions(items, scope).map(Condition::And),
            "or" => {
                self.uses.note(Feature::DisjunctivePreconditions, item.span());
                self.conditions(items, scope).map(Condition::Or)
            }
            "not" => self.negation(item, items, scope),
            "imply" => self.implication(item, items, scope),
            quantifier @ ("forall" | "exists") => self.quantified(quantifier, item.span(), items, scope),
            "=" => self.equality(item, items, scope),
            word => self.check_supported(word, head.span()).and_then(|()| self.atom(item, scope)).map(Condition::Atom),
        }
    }

    fn conditions(&mut self, items: Items<'a>, scope: &mut Variables<'a>) -> Result<Vec<Condition>, Fault> {
        items.map(|item| self.condition(item, scope)).collect()
    }

    fn negation(&mut self, whole: Item, mut items: Items<'a>, scope: &mut Variables<'a>) -> Result<Condition, Fault> {
        let part = items.expect("a condition")?;
        items.expect_end()?;
        let condition = self.condition(part, scope)?;
        if !matches!(condition, Condition::Equals(..)) {
            self.uses.note(Feature::NegativePreconditions, whole.span());
        }
        Ok(Condition::Not(Box::new(condition)))
    }

    fn implication(
        &mut self,
        whole: Item,
        mut items: Items<'a>,
        scope: &mut Variables<'a>,
    ) -> Result<Condition, Fault> {
        self.uses.note(Feature::DisjunctivePreconditions, whole.span());
        let (premise, conclusion) = (items.expect("a condition")?, items.expect("a condition")?);
        items.expect_end()?;
        let premise = self.condition(premise, scope)?;
        Ok(Condition::Imply(Box::new(premise), Box::new(self.condition(conclusion, scope)?)))
    }

    fn quantified(
        &mut self,
        quantifier: &str,
        span: Span,
        mut items: Items<'a>,
        scope: &mut Variables<'a>,
    ) -> Result<Condition, Fault> {
        let universal = quantifier == "forall";
        let feature = if universal { Feature::UniversalPreconditions } else { Feature::ExistentialPreconditions };
        self.uses.note(feature, span);
        let list = items.expect("variables in parentheses")?.list("variables in parentheses")?;
        let parameters = self.parameters(list.clone())?;
        let body = items.expect("a condition")?;
        items.expect_end()?;
        let outer = scope.len();
        bind(&parameters, &variables(list), scope);
        let body = Box::new(self.condition(body, scope)?);
        scope.truncate(outer);
        Ok(if universal { Condition::Forall(parameters, body) } else { Condition::Exists(parameters, body) })
    }

    fn equality(&mut self, whole: Item<'a>, items: Items<'a>, scope: &Variables<'a>) -> Result<Condition, Fault> {
        self.uses.note(Feature::Equality, whole.span());
        if items.clone().any(|item| item.kind() == NodeKind::List || is_number(item)) {
            return Err(Fault::unsupported(NUMERIC, whole.span()));
        }
        let terms = items.map(|item| self.term(item, &[TypeId::OBJECT], scope)).collect::<Result<Vec<_>, _>>()?;
        match terms.as_slice() {
            &[left, right] => Ok(Condition::Equals(left, right)),
            terms => {
                let kind = PddlErrorKind::Arity { name: "=".to_owned(), expected: 2, found: terms.len() };
                Err(Fault::new(kind, whole.span()))
            }
        }
    }

    fn check_supported(&self, word: &str, span: Span) -> Result<(), Fault> {
        let outside = OUTSIDE.iter().find(|&&(name, _)| name == word && !self.has_predicate(name));
        outside.map_or(Ok(()), |&(_, feature)| Err(Fault::unsupported(feature, span)))
    }
}

/// Whether the item is a number.
pub(super) fn is_number(item: Item) -> bool {
    item.as_name().is_some_and(|name| {
        name.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) && name.parse::<f64>().is_ok()
    })
}
