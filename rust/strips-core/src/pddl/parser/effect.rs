//! Effects, with the conditions and quantifiers around them, and action costs.

use super::super::ast::{Cost, Effect};
use super::super::error::{Declaration, Fault, PddlErrorKind};
use super::super::tree::{Item, Items, NodeKind};
use super::condition::{NUMERIC, is_number};
use super::names::{Names, Variables, bind, undeclared, variables};
use super::requirements::Feature;

impl<'a> Names<'a> {
    /// Reads an effect; `()` changes nothing.
    pub(super) fn effect(&mut self, item: Item<'a>, scope: &mut Variables<'a>) -> Result<Effect, Fault> {
        let mut items = item.list("an effect in parentheses")?;
        let Some(head) = items.next() else { return Ok(Effect::And(Vec::new())) };
        match head.name("a predicate or `and`, `not`, `when`, `forall`")? {
            "and" => items.map(|item| self.effect(item, scope)).collect::<Result<_, _>>().map(Effect::And),
            "not" => self.delete(items, scope),
            "when" => self.conditional(item, items, scope),
            "forall" => self.universal(item, items, scope),
            "increase" if !self.has_predicate("increase") => self.increase(head, items, scope),
            "assign" | "decrease" | "scale-up" | "scale-down" if !self.has_predicate(head.text()) => {
                Err(Fault::unsupported(NUMERIC, head.span()))
            }
            "oneof" | "probabilistic" if !self.has_predicate(head.text()) => {
                Err(Fault::unsupported("non-deterministic effects", head.span()))
            }
            "=" | "or" | "imply" | "exists" => Err(head.unexpected("an effect")),
            _ => self.changed_atom(item, scope).map(Effect::Add),
        }
    }

    fn delete(&mut self, mut items: Items<'a>, scope: &mut Variables<'a>) -> Result<Effect, Fault> {
        let atom = items.expect("an atom")?;
        items.expect_end()?;
        if matches!(atom.head(), Some("=" | "not" | "and" | "or" | "imply" | "forall" | "exists" | "when")) {
            return Err(Fault::expected("an atom", &format!("`{}`", atom.head().unwrap_or_default()), atom.span()));
        }
        self.changed_atom(atom, scope).map(Effect::Delete)
    }

    fn changed_atom(&mut self, item: Item<'a>, scope: &Variables<'a>) -> Result<super::super::ast::Atom, Fault> {
        let atom = self.atom(item, scope)?;
        let predicate = &self.predicates[atom.predicate.index()];
        if predicate.derived {
            return Err(Fault::new(PddlErrorKind::DerivedSet { name: predicate.name.clone() }, item.span()));
        }
        Ok(atom)
    }

    fn conditional(&mut self, whole: Item, mut items: Items<'a>, scope: &mut Variables<'a>) -> Result<Effect, Fault> {
        self.uses.note(Feature::ConditionalEffects, whole.span());
        let (condition, effect) = (items.expect("a condition")?, items.expect("an effect")?);
        items.expect_end()?;
        let condition = self.condition(condition, scope)?;
        Ok(Effect::When(condition, Box::new(self.effect(effect, scope)?)))
    }

    fn universal(&mut self, whole: Item, mut items: Items<'a>, scope: &mut Variables<'a>) -> Result<Effect, Fault> {
        self.uses.note(Feature::ConditionalEffects, whole.span());
        let list = items.expect("variables in parentheses")?.list("variables in parentheses")?;
        let parameters = self.parameters(list.clone())?;
        let body = items.expect("an effect")?;
        items.expect_end()?;
        let outer = scope.len();
        bind(&parameters, &variables(list), scope);
        let body = Box::new(self.effect(body, scope)?);
        scope.truncate(outer);
        Ok(Effect::Forall(parameters, body))
    }

    fn increase(&mut self, head: Item, mut items: Items<'a>, scope: &Variables<'a>) -> Result<Effect, Fault> {
        let target = items.expect("`(total-cost)`")?;
        if !is_total_cost(target) {
            return Err(Fault::unsupported(NUMERIC, head.span()));
        }
        self.uses.note(Feature::ActionCosts, head.span());
        self.has_total_cost = true;
        let amount = items.expect("an amount")?;
        items.expect_end()?;
        self.cost(amount, scope).map(Effect::IncreaseCost)
    }

    fn cost(&mut self, item: Item<'a>, scope: &Variables<'a>) -> Result<Cost, Fault> {
        if is_number(item) {
            return Ok(Cost::Number(number(item)?));
        }
        let (function, terms) = self.application(item, scope)?;
        Ok(Cost::Function(function, terms))
    }

    /// A cost function applied to terms, as `(f ?x)` or, without arguments, `f`.
    pub(super) fn application(
        &mut self,
        item: Item<'a>,
        scope: &Variables<'a>,
    ) -> Result<(usize, Vec<super::super::ast::Term>), Fault> {
        let mut items = item.list("a number or a function in parentheses")?;
        let head = items.expect("a function")?;
        let name = head.name("a function")?;
        if matches!(name, "+" | "-" | "*" | "/") {
            return Err(Fault::unsupported("arithmetic expressions", head.span()));
        }
        let known = || self.functions.iter().map(|function| function.name.as_str());
        let found = self.function_ids.get(name).copied();
        let function = found.ok_or_else(|| undeclared(Declaration::Function, name, known(), head.span()))?;
        let parameters = self.functions[function].parameters.clone();
        Ok((function, self.arguments(item, &parameters, items, scope)?))
    }
}

/// Whether the item is `(total-cost)` or `total-cost`.
pub(super) fn is_total_cost(item: Item) -> bool {
    match item.kind() {
        NodeKind::List => item.head() == Some("total-cost") && item.list("").is_ok_and(|items| items.count() == 1),
        _ => item.as_name() == Some("total-cost"),
    }
}

/// The number that the item is.
pub(super) fn number(item: Item) -> Result<f64, Fault> {
    let text = item.name("a number")?;
    let value = text.parse().ok().filter(|value: &f64| value.is_finite() && is_number(item));
    value.ok_or_else(|| item.unexpected("a number"))
}
