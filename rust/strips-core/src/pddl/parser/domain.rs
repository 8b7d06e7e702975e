//! A domain's sections.

use rustc_hash::FxHashSet;

use super::super::ast::{
    Action, Condition, CostFunction, Domain, Effect, PendingObject, Predicate, PredicateId, Warning,
};
use super::super::error::{Declaration, Fault, PddlErrorKind};
use super::super::stratify;
use super::super::tree::{Item, Items, Tree};
use super::effect::is_total_cost;
use super::names::{Names, bind, undeclared, variables};
use super::requirements::flags;
use super::sections::{Sections, Standing, content};
use super::typed_list::groups;
use super::types::Types;

const SECTIONS: [&str; 7] =
    [":requirements", ":types", ":constants", ":predicates", ":functions", ":derived", ":action"];

const ACTION_PARTS: [&str; 3] = [":parameters", ":precondition", ":effect"];

fn standing(keyword: &str) -> Option<Standing> {
    Some(match keyword {
        ":requirements" | ":types" | ":constants" | ":predicates" | ":functions" => Standing::Once,
        ":derived" | ":action" => Standing::Many,
        ":durative-action" => Standing::Unsupported("durative actions"),
        ":constraints" => Standing::Unsupported("trajectory constraints"),
        ":process" => Standing::Unsupported("processes"),
        ":event" => Standing::Unsupported("events"),
        ":axiom" => Standing::Unsupported("rules written `:axiom` (in place of `:derived`)"),
        ":method" | ":task" => Standing::Unsupported("hierarchical tasks"),
        _ => return None,
    })
}

/// Reads the definition of a domain.
pub(super) fn read(tree: &Tree) -> Result<Domain, Fault> {
    let sections = Sections::read(tree, "domain", &SECTIONS, standing)?;
    let (requirements, warnings) = sections.get(":requirements").map_or(Ok(Default::default()), flags)?;
    let mut names = declarations(&sections, warnings)?;
    let derived: Vec<Item> = sections.items(":derived").collect();
    derived.iter().try_for_each(|&section| names.note_derived(section))?;
    let axioms = derived.iter().map(|&section| names.axiom(section)).collect::<Result<Vec<_>, _>>()?;
    stratify::check(&names.predicates, &axioms)?;
    let actions = actions(&sections, &mut names)?;
    let pending = names.pending.take().unwrap_or_default();
    names.warnings.extend(pending.iter().map(warn_pending));
    names.warnings.extend(names.uses.undeclared(&requirements));
    Ok(Domain {
        name: sections.name.to_owned(),
        requirements,
        types: names.types,
        constants: names.objects,
        pending,
        predicates: names.predicates,
        axioms,
        actions,
        has_total_cost: names.has_total_cost,
        cost_functions: names.functions,
        warnings: names.warnings,
    })
}

fn warn_pending(object: &PendingObject) -> Warning {
    let message = format!("object `{}` is used but not declared; every problem must declare it", object.name);
    Warning { message, span: object.uses.first().map(|(_, span)| *span).unwrap_or_default() }
}

fn declarations<'t>(sections: &Sections<'t>, mut warnings: Vec<Warning>) -> Result<Names<'t>, Fault> {
    let types = Types::read(sections.get(":types"))?;
    warnings.extend(types.warnings);
    let (types, type_ids) = (types.list, types.ids);
    let mut names = Names { types, type_ids, warnings, pending: Some(Vec::new()), ..Names::default() };
    sections.get(":constants").map_or(Ok(()), |items| names.declare_objects(items))?;
    sections.get(":predicates").map_or(Ok(()), |items| names.declare_predicates(items))?;
    sections.get(":functions").map_or(Ok(()), |items| names.declare_functions(items))?;
    Ok(names)
}

impl<'a> Names<'a> {
    fn declare_predicates(&mut self, items: Items<'a>) -> Result<(), Fault> {
        for item in items {
            let mut parts = item.list("a predicate in parentheses")?;
            let head = parts.expect("a predicate's name")?;
            let name = head.name("a predicate's name")?;
            if name == "=" {
                let message = "`=` is built in and needs no declaration".to_owned();
                self.warnings.push(Warning { message, span: item.span() });
                continue;
            }
            if self.has_predicate(name) {
                return Err(Fault::duplicate(Declaration::Predicate, name, head.span()));
            }
            let parameters = self.parameters(parts)?;
            self.predicate_ids.insert(name, PredicateId::from(self.predicates.len()));
            self.predicates.push(Predicate { name: name.to_owned(), parameters, derived: false, span: item.span() });
        }
        Ok(())
    }

    fn declare_functions(&mut self, items: Items<'a>) -> Result<(), Fault> {
        let (groups, warnings) = groups(items)?;
        self.warnings.extend(warnings);
        for group in groups {
            if let Some((_, span)) = group.types.iter().find(|(name, _)| *name != "number") {
                return Err(Fault::unsupported("functions that yield objects", *span));
            }
            group.members.into_iter().try_for_each(|item| self.declare_function(item))?;
        }
        Ok(())
    }

    fn declare_function(&mut self, item: Item<'a>) -> Result<(), Fault> {
        let mut parts = item.list("a function in parentheses")?;
        let head = parts.expect("a function's name")?;
        let name = head.name("a function's name")?;
        if self.function_ids.contains_key(name) || (name == "total-cost" && self.has_total_cost) {
            return Err(Fault::duplicate(Declaration::Function, name, head.span()));
        }
        if is_total_cost(item) {
            self.has_total_cost = true;
            return Ok(());
        }
        let parameters = self.parameters(parts)?;
        self.function_ids.insert(name, self.functions.len());
        self.functions.push(CostFunction { name: name.to_owned(), parameters });
        Ok(())
    }

    fn action(&mut self, section: Item<'a>) -> Result<Action, Fault> {
        let mut items = content(section);
        let name = items.expect("an action's name")?.name("an action's name")?.to_owned();
        let parts = ActionParts::read(items)?;
        let mut scope = Vec::new();
        let mut parameters = Vec::new();
        if let Some(item) = parts.parameters {
            let list = item.list("parameters in parentheses")?;
            parameters = self.parameters(list.clone())?;
            bind(&parameters, &variables(list), &mut scope);
        }
        let precondition = parts.precondition.map(|item| self.condition(item, &mut scope)).transpose()?;
        let effect = parts.effect.map(|item| self.effect(item, &mut scope)).transpose()?;
        Ok(Action {
            name,
            parameters,
            precondition: precondition.unwrap_or(Condition::And(Vec::new())),
            effect: effect.unwrap_or(Effect::And(Vec::new())),
            span: section.span(),
        })
    }
}

fn actions<'t>(sections: &Sections<'t>, names: &mut Names<'t>) -> Result<Vec<Action>, Fault> {
    let mut seen = FxHashSet::default();
    let mut actions = Vec::new();
    for section in sections.items(":action") {
        let head = content(section).expect("an action's name")?;
        let name = head.name("an action's name")?;
        if !seen.insert(name) {
            return Err(Fault::duplicate(Declaration::Action, name, head.span()));
        }
        actions.push(names.action(section)?);
    }
    Ok(actions)
}

/// The values of an action's keywords.
#[derive(Default)]
struct ActionParts<'t> {
    parameters: Option<Item<'t>>,
    precondition: Option<Item<'t>>,
    effect: Option<Item<'t>>,
}

impl<'t> ActionParts<'t> {
    fn read(mut items: Items<'t>) -> Result<Self, Fault> {
        let mut parts = Self::default();
        while let Some(keyword) = items.next() {
            let name = keyword.name("`:parameters`, `:precondition` or `:effect`")?;
            let part = parts.slot(name).ok_or_else(|| unknown_part(name, keyword))?;
            if part.is_some() {
                return Err(Fault::duplicate(Declaration::Section, name, keyword.span()));
            }
            *part = Some(items.expect("a list in parentheses")?);
        }
        Ok(parts)
    }

    fn slot(&mut self, keyword: &str) -> Option<&mut Option<Item<'t>>> {
        match keyword {
            ":parameters" => Some(&mut self.parameters),
            ":precondition" => Some(&mut self.precondition),
            ":effect" => Some(&mut self.effect),
            _ => None,
        }
    }
}

fn unknown_part(name: &str, keyword: Item) -> Fault {
    match name {
        ":duration" | ":condition" => Fault::unsupported("durative actions", keyword.span()),
        _ if name.starts_with(':') => undeclared(Declaration::Section, name, ACTION_PARTS, keyword.span()),
        _ => {
            let found = format!("`{name}`");
            let expected = "`:parameters`, `:precondition` or `:effect`";
            Fault::new(PddlErrorKind::Expected { expected, found }, keyword.span())
        }
    }
}
