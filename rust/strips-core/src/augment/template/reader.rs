//! Reading a template and checking it against its domain.

use super::arrays::{Array, Relation, Rule};
use super::{Form, Hole, Kind, Pattern, Template};
use crate::pddl::ast::{Domain, Object, ObjectId, TypeId};
use crate::pddl::error::Fault;
use crate::pddl::tree::{Item, Items, NodeKind, Tree};
use crate::pddl::{Declaration, PddlError, PddlErrorKind, Source};
use crate::span::Span;

/// Reads a template of the domain.
///
/// # Errors
/// The first mistake: unbalanced parentheses, an unknown section, type, predicate or placeholder, a wrong number or
/// type of arguments.
pub fn read_template(source: &Source, domain: &Domain) -> Result<Template, PddlError> {
    let read = || {
        let tree = Tree::read(source.text())?;
        Reader { domain, placeholders: Vec::new(), local: Vec::new() }.read(tree.root())
    };
    read().map_err(|fault: Fault| fault.within(source))
}

struct Reader<'d> {
    domain: &'d Domain,
    /// Name and possible types of each placeholder.
    placeholders: Vec<(String, Vec<TypeId>)>,
    /// The same of the distractor, or of the objects of an array, that are being read.
    local: Vec<(String, Vec<TypeId>)>,
}

impl Reader<'_> {
    fn read(mut self, root: Item<'_>) -> Result<Template, Fault> {
        let mut items = root.list("`(define …)`")?;
        keyword(&mut items, "define")?;
        let mut header = items.expect("`(template NAME)`")?.list("`(template NAME)`")?;
        keyword(&mut header, "template")?;
        let name = header.expect("a name")?.name("a name")?.to_owned();
        let mut template = Template {
            name,
            placeholders: vec![],
            arrays: vec![],
            distractors: (0, 0),
            kinds: vec![],
            init: vec![],
            goal: None,
        };
        for item in items {
            self.section(item, &mut template)?;
        }
        Ok(template)
    }

    fn section(&mut self, item: Item<'_>, template: &mut Template) -> Result<(), Fault> {
        let mut items = item.list("a section")?;
        let head = items.expect("a section")?;
        match head.text() {
            ":domain" => self.check_domain(&mut items),
            ":parameters" => {
                self.placeholders = self.typed_variables(&mut items)?;
                template.placeholders = self.placeholders.iter().map(|(_, types)| types.clone()).collect();
                Ok(())
            }
            ":array" => self.array(&mut items).map(|array| template.arrays.push(array)),
            ":distractors" => self.distractors(&mut items, template),
            ":init" => self.forms(items).map(|forms| template.init = forms),
            ":goal" => self.goal(&mut items).map(|goal| template.goal = Some(goal)),
            _ => Err(head.unexpected("`:domain`, `:parameters`, `:array`, `:distractors`, `:init` or `:goal`")),
        }
    }

    fn check_domain(&self, items: &mut Items<'_>) -> Result<(), Fault> {
        let item = items.expect("the domain's name")?;
        if item.as_name() == Some(&self.domain.name) { Ok(()) } else { Err(item.unexpected("the domain's own name")) }
    }

    /// `?x ?y - TYPE …`, each variable followed, sooner or later, by a type.
    fn typed_variables(&self, items: &mut Items<'_>) -> Result<Vec<(String, Vec<TypeId>)>, Fault> {
        let (mut read, mut waiting) = (Vec::new(), Vec::new());
        while let Some(item) = items.next() {
            if item.text() == "-" {
                let types = self.types(items.expect("a type")?)?;
                read.extend(waiting.drain(..).map(|name| (name, types.clone())));
            } else {
                waiting.push(variable(item)?);
            }
        }
        if waiting.is_empty() { Ok(read) } else { Err(Fault::expected("`-` and a type", "`)`", items.closing())) }
    }

    fn types(&self, item: Item<'_>) -> Result<Vec<TypeId>, Fault> {
        if item.kind() != NodeKind::List {
            return Ok(vec![self.type_id(item)?]);
        }
        let mut items = item.list("a type")?;
        keyword(&mut items, "either")?;
        items.map(|item| self.type_id(item)).collect()
    }

    fn type_id(&self, item: Item<'_>) -> Result<TypeId, Fault> {
        let name = item.name("a type")?;
        self.domain.type_id(name).ok_or_else(|| undeclared(Declaration::Type, item))
    }

    fn distractors(&mut self, items: &mut Items<'_>, template: &mut Template) -> Result<(), Fault> {
        let (least, most) = (number(items.expect("a number")?)?, items.expect("a number")?);
        template.distractors = (least, number(most)?);
        if template.distractors.1 < least {
            return Err(most.unexpected("a number that is not less than the one before"));
        }
        for item in items {
            let kind = self.kind(item)?;
            template.kinds.push(kind);
        }
        Ok(())
    }

    fn kind(&mut self, item: Item<'_>) -> Result<Kind, Fault> {
        let mut items = item.list("a kind of distractor")?;
        let name = variable(items.expect("a variable")?)?;
        keyword(&mut items, "-")?;
        let types = self.types(items.expect("a type")?)?;
        self.local = vec![(name, types.clone())];
        let forms = self.forms(items)?;
        self.local.clear();
        Ok(Kind { types, forms })
    }

    /// `TYPE (SIZE…) (RELATION ?x … FORM…)…`
    fn array(&mut self, items: &mut Items<'_>) -> Result<Array, Fault> {
        let type_id = self.type_id(items.expect("a type")?)?;
        let sizes = items.expect("sizes in parentheses")?.list("sizes in parentheses")?;
        let sizes = sizes.map(positive).collect::<Result<Vec<usize>, Fault>>()?;
        let rules = items.map(|item| self.rule(item, type_id)).collect::<Result<_, Fault>>()?;
        Ok(Array { type_id, sizes, rules })
    }

    fn rule(&mut self, item: Item<'_>, type_id: TypeId) -> Result<Rule, Fault> {
        const EXPECTED: &str =
            "`(each ?x …)`, `(first ?x …)`, `(last ?x …)`, `(pairs ?x ?y …)` or `(neighbours ?x ?y …)`";
        let mut items = item.list(EXPECTED)?;
        let head = items.expect(EXPECTED)?;
        let (of, objects) = Relation::of_name(head.text()).ok_or_else(|| head.unexpected(EXPECTED))?;
        for _ in 0..objects {
            self.local.push((variable(items.expect("a variable")?)?, vec![type_id]));
        }
        let forms = self.forms(items)?;
        self.local.clear();
        Ok(Rule { of, forms })
    }

    fn forms(&self, items: Items<'_>) -> Result<Vec<Form>, Fault> {
        items.map(|item| self.form(item)).collect()
    }

    fn form(&self, item: Item<'_>) -> Result<Form, Fault> {
        let mut items = item.list("an atom, `(and …)` or `(oneof …)`")?;
        match item.head() {
            Some("and") => {
                items.next();
                Ok(Form::And(self.forms(items)?))
            }
            Some("oneof") => {
                items.next();
                Ok(Form::OneOf(self.forms(items)?))
            }
            _ => Ok(Form::Atom(self.pattern(item)?)),
        }
    }

    fn goal(&self, items: &mut Items<'_>) -> Result<Vec<(bool, Pattern)>, Fault> {
        let item = items.expect("a literal or `(and …)`")?;
        let mut parts = item.list("a literal or `(and …)`")?;
        if item.head() == Some("and") {
            parts.next();
            return parts.map(|part| self.literal(part)).collect();
        }
        Ok(vec![self.literal(item)?])
    }

    fn literal(&self, item: Item<'_>) -> Result<(bool, Pattern), Fault> {
        let positive = item.head() != Some("not");
        let atom = if positive {
            item
        } else {
            let mut items = item.list("a literal")?;
            items.next();
            items.expect("an atom")?
        };
        let pattern = self.pattern(atom)?;
        let drawn = pattern.terms.iter().any(|hole| matches!(hole, Hole::Local(_) | Hole::Any(_)));
        if drawn { Err(atom.unexpected("an atom without `(any …)`")) } else { Ok((positive, pattern)) }
    }

    fn pattern(&self, item: Item<'_>) -> Result<Pattern, Fault> {
        let mut items = item.list("an atom")?;
        let head = items.expect("a predicate")?;
        let name = head.name("a predicate")?;
        let predicate = self.domain.predicate(name).ok_or_else(|| undeclared(Declaration::Predicate, head))?;
        let parameters = &self.domain.predicates[predicate.index()].parameters;
        let terms: Vec<Item<'_>> = items.collect();
        if terms.len() != parameters.len() {
            let (expected, found) = (parameters.len(), terms.len());
            return Err(Fault::new(PddlErrorKind::Arity { name: name.to_owned(), expected, found }, item.span()));
        }
        let fill = |(term, parameter): (&Item<'_>, &crate::pddl::ast::Parameter)| {
            let (hole, types) = self.hole(*term)?;
            self.check_types(*term, &types, name, &parameter.types)?;
            Ok(hole)
        };
        let terms = terms.iter().zip(parameters).map(fill).collect::<Result<_, Fault>>()?;
        Ok(Pattern { predicate, terms })
    }

    /// What the term is, and the types of which it may be.
    fn hole(&self, term: Item<'_>) -> Result<(Hole, Vec<TypeId>), Fault> {
        match term.kind() {
            NodeKind::List => {
                let mut items = term.list("`(any TYPE)`")?;
                keyword(&mut items, "any")?;
                let type_id = self.type_id(items.expect("a type")?)?;
                Ok((Hole::Any(type_id), vec![type_id]))
            }
            NodeKind::Variable => self.variable_hole(term),
            NodeKind::Name => {
                let found = self.domain.constants.iter().position(|constant| constant.name == term.text());
                let index = found.ok_or_else(|| undeclared(Declaration::Object, term))?;
                Ok((Hole::Constant(ObjectId::from(index)), self.domain.constants[index].types.clone()))
            }
        }
    }

    fn variable_hole(&self, term: Item<'_>) -> Result<(Hole, Vec<TypeId>), Fault> {
        if let Some(number) = self.local.iter().position(|(name, _)| name == term.text()) {
            return Ok((Hole::Local(number), self.local[number].1.clone()));
        }
        let found = self.placeholders.iter().position(|(name, _)| name == term.text());
        let index = found.ok_or_else(|| undeclared(Declaration::Variable, term))?;
        Ok((Hole::Placeholder(index), self.placeholders[index].1.clone()))
    }

    /// Each alternative must fit: a template that fails for some of its choices is wrong.
    fn check_types(&self, term: Item<'_>, types: &[TypeId], name: &str, wanted: &[TypeId]) -> Result<(), Fault> {
        let object = |type_id| Object { name: String::new(), types: vec![type_id], span: Span::default() };
        let Some(&bad) = types.iter().find(|&&type_id| !self.domain.accepts(wanted, &object(type_id))) else {
            return Ok(());
        };
        let type_name = |id: TypeId| self.domain.types[id.index()].name.clone();
        let wanted = wanted.iter().map(|&id| type_name(id)).collect::<Vec<_>>().join(" or ");
        let (term_text, found, name) = (term.text().to_owned(), type_name(bad), name.to_owned());
        Err(Fault::new(PddlErrorKind::WrongType { term: term_text, found, name, wanted }, term.span()))
    }
}

fn keyword(items: &mut Items<'_>, word: &'static str) -> Result<(), Fault> {
    let item = items.expect(word)?;
    if item.text() == word { Ok(()) } else { Err(item.unexpected(word)) }
}

fn variable(item: Item<'_>) -> Result<String, Fault> {
    match item.kind() {
        NodeKind::Variable => Ok(item.text().to_owned()),
        _ => Err(item.unexpected("a variable")),
    }
}

fn number(item: Item<'_>) -> Result<usize, Fault> {
    item.text().parse().map_err(|_| item.unexpected("a number"))
}

fn positive(item: Item<'_>) -> Result<usize, Fault> {
    match number(item)? {
        0 => Err(item.unexpected("a positive number")),
        number => Ok(number),
    }
}

fn undeclared(what: Declaration, item: Item<'_>) -> Fault {
    Fault::new(PddlErrorKind::Undeclared { what, name: item.text().to_owned(), suggestion: None }, item.span())
}
