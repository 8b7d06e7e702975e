//! A problem's sections, read against its domain.

use std::hash::BuildHasher;

use rustc_hash::{FxBuildHasher, FxHashSet};

use super::super::ast::{
    CostFunction, Domain, GroundAtom, Object, ObjectId, PendingObject, PredicateId, Problem, Term, TypeId, Warning,
};
use super::super::edit_distance::nearest;
use super::super::error::{Declaration, Fault, PddlErrorKind};
use super::super::lookup::is_subtype;
use super::super::tree::{Item, Items, NodeKind, Tree};
use super::condition::{NUMERIC, is_number};
use super::effect::{is_total_cost, number};
use super::names::{Names, type_text};
use super::requirements::{Feature, flags};
use super::sections::{Sections, Standing};
use crate::span::Span;

const SECTIONS: [&str; 6] = [":domain", ":requirements", ":objects", ":init", ":goal", ":metric"];

fn standing(keyword: &str) -> Option<Standing> {
    Some(match keyword {
        ":domain" | ":requirements" | ":objects" | ":init" | ":goal" | ":metric" | ":length" => Standing::Once,
        ":constraints" => Standing::Unsupported("trajectory constraints"),
        ":htn" => Standing::Unsupported("hierarchical tasks"),
        _ => return None,
    })
}

/// A mistake in a problem, or in its domain as only the problem shows.
pub(super) struct ProblemFault {
    /// The mistake, with its place in the problem's text.
    pub(super) fault: Fault,
    /// Its place in the domain's text, where that shows it better.
    pub(super) in_domain: Option<Span>,
}

impl From<Fault> for ProblemFault {
    fn from(fault: Fault) -> Self {
        Self { fault, in_domain: None }
    }
}

/// Reads the definition of a problem of `domain`.
pub(super) fn read<'a>(tree: &'a Tree, domain: &'a Domain) -> Result<Problem, ProblemFault> {
    let sections = Sections::read(tree, "problem", &SECTIONS, standing)?;
    let goal = goal_item(sections.require(":goal")?)?;
    let (requirements, warnings) = sections.get(":requirements").map_or(Ok(Default::default()), flags)?;
    let mut names = Names { warnings, ..names_of(domain) };
    let home = check_domain_name(&mut names, sections.require(":domain")?, domain)?;
    sections.get(":objects").map_or(Ok(()), |items| names.declare_objects(items))?;
    check_pending(&names, domain, home)?;
    let (init, costs) = Init::read(&mut names, sections.require(":init")?)?;
    names.warnings.extend(unvalued(domain, &costs, home));
    let (goal, goal_span) = (names.condition(goal, &mut Vec::new())?, goal.span());
    let minimizes_cost = sections.get(":metric").map_or(Ok(false), |items| metric(&mut names, items))?;
    sections.items(":length").for_each(|item| {
        names.warnings.push(Warning { message: "`:length` is ignored".to_owned(), span: item.span() });
    });
    let declared = [domain.requirements.as_slice(), &requirements].concat();
    names.warnings.extend(names.uses.undeclared(&declared));
    let (name, objects, warnings) = (sections.name.to_owned(), names.objects, names.warnings);
    Ok(Problem { name, objects, init, costs, goal, minimizes_cost, goal_span, requirements, warnings })
}

fn goal_item(mut items: Items<'_>) -> Result<Item<'_>, Fault> {
    let item = items.expect("a condition in parentheses")?;
    item.list("a condition in parentheses")?;
    items.expect_end()?;
    Ok(item)
}

/// The domain's declarations; pending objects stand without types until the problem declares them.
fn names_of(domain: &Domain) -> Names<'_> {
    let pending = domain.pending.iter().map(|object| object.name.as_str());
    let placeholder = |name: &str| Object { name: name.to_owned(), types: Vec::new(), span: Span::default() };
    let objects: Vec<Object> = domain.constants.iter().cloned().chain(pending.clone().map(placeholder)).collect();
    let object_names = domain.constants.iter().map(|object| object.name.as_str()).chain(pending);
    let kinds = domain.types.iter().enumerate();
    let predicates = domain.predicates.iter().enumerate();
    let functions = domain.cost_functions.iter().enumerate();
    Names {
        types: domain.types.clone(),
        type_ids: kinds.map(|(id, kind)| (kind.name.as_str(), TypeId::from(id))).collect(),
        predicates: domain.predicates.clone(),
        predicate_ids: predicates.map(|(id, one)| (one.name.as_str(), PredicateId::from(id))).collect(),
        functions: domain.cost_functions.clone(),
        function_ids: functions.map(|(id, one)| (one.name.as_str(), id)).collect(),
        object_ids: object_names.enumerate().map(|(id, name)| (name, ObjectId::from(id))).collect(),
        objects,
        has_total_cost: domain.has_total_cost,
        ..Names::default()
    }
}

/// Where the problem names its domain; a warning where that is another one.
fn check_domain_name(names: &mut Names, mut items: Items, domain: &Domain) -> Result<Span, Fault> {
    let item = items.expect("a domain's name")?;
    let name = item.name("a domain's name")?;
    items.expect_end()?;
    if name != domain.name {
        let message = format!("the problem is of domain `{name}`, not `{}`", domain.name);
        names.warnings.push(Warning { message, span: item.span() });
    }
    Ok(item.span())
}

/// Warnings of cost functions to which the problem gives no value at all.
fn unvalued(domain: &Domain, costs: &[(usize, Vec<ObjectId>, f64)], home: Span) -> Vec<Warning> {
    let missing = |(id, _): &(usize, &CostFunction)| costs.iter().all(|(function, ..)| function != id);
    let warning = |(_, function): (usize, &CostFunction)| {
        let message = format!("`{}` has no value in `:init`: as a cost it counts as 0", function.name);
        Warning { message, span: home }
    };
    domain.cost_functions.iter().enumerate().filter(missing).map(warning).collect()
}

/// Every object that the domain names must be declared by now, and of the types that it is used as.
fn check_pending(names: &Names, domain: &Domain, home: Span) -> Result<(), ProblemFault> {
    for (pending, object) in domain.pending.iter().zip(&names.objects[domain.constants.len()..]) {
        let fault = if object.types.is_empty() {
            pending.uses.first().map(|&(_, span)| (undeclared_object(names, pending), span))
        } else {
            let misfit = pending.uses.iter().find(|(wanted, _)| !is_one_of(names, object, wanted));
            misfit.map(|(wanted, span)| (wrong_use(names, object, wanted), *span))
        };
        if let Some((kind, span)) = fault {
            return Err(ProblemFault { fault: Fault::new(kind, home), in_domain: Some(span) });
        }
    }
    Ok(())
}

fn is_one_of(names: &Names, object: &Object, wanted: &[TypeId]) -> bool {
    object.types.iter().any(|&sub| wanted.iter().any(|&sup| is_subtype(&names.types, sub, sup)))
}

fn undeclared_object(names: &Names, pending: &PendingObject) -> PddlErrorKind {
    let declared = names.objects.iter().filter(|object| !object.types.is_empty());
    let suggestion = nearest(&pending.name, declared.map(|object| object.name.as_str()));
    PddlErrorKind::Undeclared { what: Declaration::Object, name: pending.name.clone(), suggestion }
}

fn wrong_use(names: &Names, object: &Object, wanted: &[TypeId]) -> PddlErrorKind {
    let (found, wanted) = (type_text(&names.types, &object.types), type_text(&names.types, wanted));
    PddlErrorKind::WrongType { term: object.name.clone(), found, name: "the domain".to_owned(), wanted }
}

/// Values of cost functions: (function, arguments, value).
type Costs = Vec<(usize, Vec<ObjectId>, f64)>;

/// The initial state under construction.
#[derive(Default)]
struct Init {
    atoms: Vec<GroundAtom>,
    /// Hashes of the atoms so far.
    hashes: FxHashSet<u64>,
    /// The atoms so far, once two hashes were the same: without duplicates, as is usual, no atom is copied.
    seen: Option<FxHashSet<GroundAtom>>,
    costs: Costs,
}

impl Init {
    fn read<'a>(names: &mut Names<'a>, items: Items<'a>) -> Result<(Vec<GroundAtom>, Costs), Fault> {
        let mut init = Self::default();
        for item in items {
            match item.head() {
                Some("=") => init.value(names, item)?,
                Some("not") => negative(names, item)?,
                Some("at") if is_timed(item) => {
                    return Err(Fault::unsupported("timed initial literals", item.span()));
                }
                _ => init.atom(names, item)?,
            }
        }
        Ok((init.atoms, init.costs))
    }

    fn atom<'a>(&mut self, names: &mut Names<'a>, item: Item<'a>) -> Result<(), Fault> {
        let atom = ground_atom(names, item)?;
        if self.is_new(&atom) {
            self.atoms.push(atom);
        }
        Ok(())
    }

    fn is_new(&mut self, atom: &GroundAtom) -> bool {
        let unknown_hash = self.hashes.insert(FxBuildHasher.hash_one(atom));
        if unknown_hash && self.seen.is_none() {
            return true;
        }
        let seen = self.seen.get_or_insert_with(|| self.atoms.iter().cloned().collect());
        seen.insert(atom.clone())
    }

    /// `(= (f a …) number)`.
    fn value<'a>(&mut self, names: &mut Names<'a>, item: Item<'a>) -> Result<(), Fault> {
        let mut items = item.list("`(= (function …) number)`")?;
        items.next();
        let (function, value) = (items.expect("a function")?, items.expect("a number")?);
        items.expect_end()?;
        if is_total_cost(function) {
            names.has_total_cost = true;
            return number(value).map(|_| ());
        }
        let (id, terms) = names.application(function, &Vec::new())?;
        self.costs.push((id, objects(terms), number(value)?));
        Ok(())
    }
}

fn ground_atom<'a>(names: &mut Names<'a>, item: Item<'a>) -> Result<GroundAtom, Fault> {
    let atom = names.atom(item, &Vec::new())?;
    let predicate = &names.predicates[atom.predicate.index()];
    if predicate.derived {
        return Err(Fault::new(PddlErrorKind::DerivedSet { name: predicate.name.clone() }, item.span()));
    }
    Ok(GroundAtom { predicate: atom.predicate, args: objects(atom.terms) })
}

fn objects(terms: Vec<Term>) -> Vec<ObjectId> {
    let object = |term| match term {
        Term::Object(id) => Some(id),
        Term::Variable(_) => None, // no variable is in scope here, so none was resolved
    };
    terms.into_iter().filter_map(object).collect()
}

/// `(not (p a))` says what is so anyway: what is not listed is false.
fn negative<'a>(names: &mut Names<'a>, item: Item<'a>) -> Result<(), Fault> {
    let mut items = item.list("an atom")?;
    items.next();
    ground_atom(names, items.expect("an atom")?)?;
    items.expect_end()?;
    let message = "a negative literal in `:init` has no effect".to_owned();
    names.warnings.push(Warning { message, span: item.span() });
    Ok(())
}

/// `(at 5 (p))`, unless that could be an atom.
fn is_timed(item: Item) -> bool {
    let parts: Vec<Item> = item.list("an atom").map(Iterator::collect).unwrap_or_default();
    matches!(parts.as_slice(), [_, time, literal] if is_number(*time) && literal.kind() == NodeKind::List)
}

/// Whether the metric is to minimize `total-cost`.
fn metric(names: &mut Names, mut items: Items) -> Result<bool, Fault> {
    let direction = items.expect("`minimize`")?;
    let quantity = items.expect("`(total-cost)`")?;
    items.expect_end()?;
    if direction.as_name() == Some("maximize") {
        return Err(Fault::unsupported("metrics to maximize", direction.span()));
    }
    if direction.as_name() != Some("minimize") {
        return Err(direction.unexpected("`minimize`"));
    }
    if matches!(quantity.head().or(quantity.as_name()), Some("total-time")) {
        let message = "`total-time` is ignored: every action takes one step".to_owned();
        names.warnings.push(Warning { message, span: quantity.span() });
        return Ok(false);
    }
    if !is_total_cost(quantity) {
        return Err(Fault::unsupported(NUMERIC, quantity.span()));
    }
    names.uses.note(Feature::ActionCosts, quantity.span());
    Ok(true)
}
