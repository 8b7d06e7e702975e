//! What is declared so far, and the checks of names, arities and types against it.

use rustc_hash::FxHashMap;

use super::super::ast::{
    Atom, CostFunction, Object, ObjectId, Parameter, PendingObject, Predicate, PredicateId, Term, Type, TypeId,
    VariableId, Warning,
};
use super::super::edit_distance::nearest;
use super::super::error::{Declaration, Fault, PddlErrorKind};
use super::super::lookup::is_subtype;
use super::super::tree::{Item, Items, NodeKind};
use super::requirements::{Feature, Uses};
use super::typed_list::groups;
use crate::span::Span;

/// The declarations that conditions and effects are read against.
#[derive(Default)]
pub(super) struct Names<'a> {
    pub(super) types: Vec<Type>,
    pub(super) type_ids: FxHashMap<&'a str, TypeId>,
    pub(super) predicates: Vec<Predicate>,
    pub(super) predicate_ids: FxHashMap<&'a str, PredicateId>,
    pub(super) functions: Vec<CostFunction>,
    pub(super) function_ids: FxHashMap<&'a str, usize>,
    pub(super) objects: Vec<Object>,
    pub(super) object_ids: FxHashMap<&'a str, ObjectId>,
    /// Objects that a domain uses and does not declare; none in a problem, where all are declared.
    pub(super) pending: Option<Vec<PendingObject>>,
    pub(super) has_total_cost: bool,
    pub(super) uses: Uses,
    pub(super) warnings: Vec<Warning>,
}

/// The variables in scope, the innermost last.
pub(super) type Variables<'a> = Vec<(&'a str, Vec<TypeId>)>;

impl<'a> Names<'a> {
    /// The types that a typed list names; `object` where it names none.
    pub(super) fn resolve_types(&mut self, names: &[(&'a str, Span)]) -> Result<Vec<TypeId>, Fault> {
        let Some(&(_, span)) = names.first() else { return Ok(vec![TypeId::OBJECT]) };
        self.uses.note(Feature::Typing, span);
        names.iter().map(|&(name, span)| self.type_id(name, span)).collect()
    }

    fn type_id(&self, name: &str, span: Span) -> Result<TypeId, Fault> {
        let found = self.type_ids.get(name).copied();
        found.ok_or_else(|| undeclared(Declaration::Type, name, self.types.iter().map(|kind| kind.name.as_str()), span))
    }

    /// A typed list of variables that all differ.
    pub(super) fn parameters(&mut self, items: Items<'a>) -> Result<Vec<Parameter>, Fault> {
        let (groups, warnings) = groups(items)?;
        self.warnings.extend(warnings);
        let mut parameters: Vec<Parameter> = Vec::new();
        for group in groups {
            let types = self.resolve_types(&group.types)?;
            for item in group.members {
                let name = variable_name(item, "a variable such as `?x`")?;
                if parameters.iter().any(|earlier| earlier.name == name) {
                    return Err(Fault::duplicate(Declaration::Variable, item.text(), item.span()));
                }
                parameters.push(Parameter { name: name.to_owned(), types: types.clone(), span: item.span() });
            }
        }
        Ok(parameters)
    }

    /// Whether a predicate of that name is declared.
    pub(super) fn has_predicate(&self, name: &str) -> bool {
        self.predicate_ids.contains_key(name)
    }

    /// The predicate that `head` names.
    pub(super) fn predicate(&self, head: Item<'a>) -> Result<PredicateId, Fault> {
        let name = head.name("a predicate")?;
        let known = || self.predicates.iter().map(|predicate| predicate.name.as_str());
        let found = self.predicate_ids.get(name).copied();
        found.ok_or_else(|| undeclared(Declaration::Predicate, name, known(), head.span()))
    }

    /// `(predicate term …)`, its arity and types checked.
    pub(super) fn atom(&mut self, item: Item<'a>, scope: &Variables<'a>) -> Result<Atom, Fault> {
        let mut items = item.list("an atom in parentheses")?;
        let predicate = self.predicate(items.expect("a predicate")?)?;
        let parameters = std::mem::take(&mut self.predicates[predicate.index()].parameters);
        let terms = self.arguments(item, &parameters, items, scope);
        self.predicates[predicate.index()].parameters = parameters;
        Ok(Atom { predicate, terms: terms? })
    }

    /// The arguments of a predicate or function with these parameters.
    pub(super) fn arguments(
        &mut self,
        whole: Item<'a>,
        parameters: &[Parameter],
        items: Items<'a>,
        scope: &Variables<'a>,
    ) -> Result<Vec<Term>, Fault> {
        let name = whole.head().unwrap_or_default();
        let (expected, found) = (parameters.len(), items.clone().count());
        if expected != found {
            return Err(Fault::new(PddlErrorKind::Arity { name: name.to_owned(), expected, found }, whole.span()));
        }
        items.zip(parameters).map(|(item, parameter)| self.argument(name, item, &parameter.types, scope)).collect()
    }

    fn argument(
        &mut self,
        name: &str,
        item: Item<'a>,
        wanted: &[TypeId],
        scope: &Variables<'a>,
    ) -> Result<Term, Fault> {
        let term = self.term(item, wanted, scope)?;
        let fits = |&sub: &TypeId| wanted.iter().any(|&sup| is_subtype(&self.types, sub, sup));
        let (right, found) = match term {
            Term::Variable(id) => (scope[id.index()].1.iter().all(fits), &scope[id.index()].1),
            Term::Object(id) => match self.objects.get(id.index()) {
                Some(object) => (object.types.iter().any(fits), &object.types),
                None => return Ok(term), // pending: the problem's reader checks the uses noted
            },
        };
        if right { Ok(term) } else { Err(self.wrong_type(name, item, found, wanted)) }
    }

    fn wrong_type(&self, name: &str, item: Item, found: &[TypeId], wanted: &[TypeId]) -> Fault {
        let (found, wanted) = (type_text(&self.types, found), type_text(&self.types, wanted));
        let (term, name) = (item.text().to_owned(), format!("`{name}`"));
        Fault::new(PddlErrorKind::WrongType { term, found, name, wanted }, item.span())
    }

    /// A variable in scope or an object; an unknown object of a domain is noted as pending, to be one of `wanted`.
    pub(super) fn term(&mut self, item: Item<'a>, wanted: &[TypeId], scope: &Variables<'a>) -> Result<Term, Fault> {
        match item.kind() {
            NodeKind::List => Err(item.unexpected("a variable or an object")),
            NodeKind::Variable => variable(item, scope).map(Term::Variable),
            NodeKind::Name => self.object(item, wanted).map(Term::Object),
        }
    }

    fn object(&mut self, item: Item<'a>, wanted: &[TypeId]) -> Result<ObjectId, Fault> {
        let name = item.name("an object")?;
        let declared = self.objects.len();
        let known = self.object_ids.get(name).copied();
        let Some(pending) = &mut self.pending else {
            let names = || self.objects.iter().map(|object| object.name.as_str());
            return known.ok_or_else(|| undeclared(Declaration::Object, name, names(), item.span()));
        };
        let id = known.unwrap_or_else(|| ObjectId::from(declared + pending.len()));
        if known.is_none() {
            pending.push(PendingObject { name: name.to_owned(), uses: Vec::new() });
            self.object_ids.insert(name, id);
        }
        if let Some(position) = id.index().checked_sub(declared) {
            pending[position].uses.push((wanted.to_vec(), item.span()));
        }
        Ok(id)
    }
}

/// The error that nothing declares `name`, with the nearest of the `known` names.
pub(super) fn undeclared<'n>(
    what: Declaration,
    name: &str,
    known: impl IntoIterator<Item = &'n str>,
    span: Span,
) -> Fault {
    let suggestion = nearest(name, known);
    Fault::new(PddlErrorKind::Undeclared { what, name: name.to_owned(), suggestion }, span)
}

/// The types as PDDL writes them.
pub(super) fn type_text(types: &[Type], ids: &[TypeId]) -> String {
    match ids {
        [id] => format!("`{}`", types[id.index()].name),
        ids => {
            let names: Vec<&str> = ids.iter().map(|id| types[id.index()].name.as_str()).collect();
            format!("`(either {})`", names.join(" "))
        }
    }
}

/// The variables that parameters bring into scope.
pub(super) fn bind<'a>(parameters: &[Parameter], items: &[Item<'a>], scope: &mut Variables<'a>) {
    let names = items.iter().map(|item| &item.text()[1..]);
    scope.extend(names.zip(parameters).map(|(name, parameter)| (name, parameter.types.clone())));
}

/// The variables of a typed list, without their types.
pub(super) fn variables(items: Items<'_>) -> Vec<Item<'_>> {
    items.filter(|item| item.kind() == NodeKind::Variable).collect()
}

fn variable_name<'t>(item: Item<'t>, expected: &'static str) -> Result<&'t str, Fault> {
    if item.kind() == NodeKind::Variable { Ok(&item.text()[1..]) } else { Err(item.unexpected(expected)) }
}

fn variable(item: Item, scope: &Variables) -> Result<VariableId, Fault> {
    let name = &item.text()[1..];
    let found = scope.iter().rposition(|&(known, _)| known == name).map(VariableId::from);
    found.ok_or_else(|| {
        match undeclared(Declaration::Variable, name, scope.iter().map(|&(known, _)| known), item.span()) {
            Fault { kind: PddlErrorKind::Undeclared { what, name, suggestion }, span } => {
                let suggestion = suggestion.map(|known| format!("?{known}"));
                Fault::new(PddlErrorKind::Undeclared { what, name: format!("?{name}"), suggestion }, span)
            }
            fault => fault,
        }
    })
}
