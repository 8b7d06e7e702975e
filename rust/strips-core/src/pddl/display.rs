//! Syntax trees as PDDL text that parses back to an equal tree.

use std::fmt::{self, Write as _};

use super::ast::{
    Action, Atom, Axiom, Condition, Cost, CostFunction, Domain, Effect, Object, ObjectId, Parameter, Predicate,
    Problem, Term, Type, TypeId,
};

/// The domain as PDDL.
pub fn print_domain(domain: &Domain) -> String {
    let constants = domain.constants.iter().map(|object| object.name.as_str());
    let objects = constants.chain(domain.pending.iter().map(|object| object.name.as_str())).collect();
    let mut printer = Printer { domain, objects, variables: Vec::new(), out: String::new() };
    printer.domain().expect("writing to a string never fails");
    printer.out
}

/// The problem as PDDL.
pub fn print_problem(problem: &Problem, domain: &Domain) -> String {
    let mut printer = Printer::of_problem(problem, domain);
    printer.problem(problem).expect("writing to a string never fails");
    printer.out
}

/// A condition as PDDL, on one line, with the objects of `binding` in place of its free variables; a goal has none.
pub fn print_condition(condition: &Condition, binding: &[ObjectId], problem: &Problem, domain: &Domain) -> String {
    let mut printer = Printer::of_problem(problem, domain);
    printer.variables = binding.iter().map(|id| problem.objects[id.index()].name.clone()).collect();
    printer.condition(condition).expect("writing to a string never fails");
    printer.out
}

struct Printer<'d> {
    domain: &'d Domain,
    /// Names by object id.
    objects: Vec<&'d str>,
    /// What to write for the variables in scope, by variable id.
    variables: Vec<String>,
    out: String,
}

impl<'d> Printer<'d> {
    fn of_problem(problem: &'d Problem, domain: &'d Domain) -> Self {
        let objects = problem.objects.iter().map(|object| object.name.as_str()).collect();
        Self { domain, objects, variables: Vec::new(), out: String::new() }
    }

    fn domain(&mut self) -> fmt::Result {
        let domain = self.domain;
        write!(self.out, "(define (domain {})", domain.name)?;
        self.requirements(&domain.requirements)?;
        self.section(":types", domain.types.iter().skip(1).flat_map(|kind| kind_lines(kind, &domain.types)))?;
        let constants: Vec<String> = domain.constants.iter().map(|object| self.object(object)).collect();
        self.section(":constants", constants)?;
        let predicates: Vec<String> = domain.predicates.iter().map(|predicate| self.predicate(predicate)).collect();
        self.section(":predicates", predicates)?;
        self.functions()?;
        domain.axioms.iter().try_for_each(|axiom| self.axiom(axiom))?;
        domain.actions.iter().try_for_each(|action| self.action(action))?;
        self.out.write_str(")\n")
    }

    fn problem(&mut self, problem: &Problem) -> fmt::Result {
        write!(self.out, "(define (problem {})\n  (:domain {})", problem.name, self.domain.name)?;
        self.requirements(&problem.requirements)?;
        let own = problem.objects.iter().skip(self.domain.constants.len());
        let objects: Vec<String> = own.map(|object| self.object(object)).collect();
        self.section(":objects", objects)?;
        let atoms = problem.init.iter().map(|atom| {
            let predicate = &self.domain.predicates[atom.predicate.index()].name;
            self.ground(predicate, &atom.args)
        });
        let costs = problem.costs.iter().map(|(function, args, value)| {
            let function = &self.domain.cost_functions[*function].name;
            format!("(= {} {value})", self.ground(function, args))
        });
        let lines: Vec<String> = atoms.chain(costs).collect();
        self.out.write_str("\n  (:init")?;
        self.lines(lines)?;
        self.out.write_str("\n  (:goal ")?;
        self.condition(&problem.goal)?;
        self.out.write_str(")")?;
        if problem.minimizes_cost {
            self.out.write_str("\n  (:metric minimize (total-cost))")?;
        }
        self.out.write_str(")\n")
    }

    fn ground(&self, name: &str, args: &[ObjectId]) -> String {
        let words = std::iter::once(name).chain(args.iter().map(|id| self.objects[id.index()]));
        format!("({})", words.collect::<Vec<_>>().join(" "))
    }

    fn requirements(&mut self, flags: &[String]) -> fmt::Result {
        if flags.is_empty() {
            return Ok(());
        }
        let flags: Vec<String> = flags.iter().map(|flag| format!(":{flag}")).collect();
        write!(self.out, "\n  (:requirements {})", flags.join(" "))
    }

    /// `(keyword line…)`, a line each, or nothing where there are no lines.
    fn section(&mut self, keyword: &str, lines: impl IntoIterator<Item = String>) -> fmt::Result {
        let mut lines = lines.into_iter().peekable();
        if lines.peek().is_none() {
            return Ok(());
        }
        write!(self.out, "\n  ({keyword}")?;
        self.lines(lines)
    }

    fn lines(&mut self, lines: impl IntoIterator<Item = String>) -> fmt::Result {
        lines.into_iter().try_for_each(|line| write!(self.out, "\n    {line}"))?;
        self.out.write_str(")")
    }

    fn object(&self, object: &Object) -> String {
        format!("{} - {}", object.name, self.types(&object.types))
    }

    fn types(&self, ids: &[TypeId]) -> String {
        let names: Vec<&str> = ids.iter().map(|id| self.domain.types[id.index()].name.as_str()).collect();
        if names.len() == 1 { names[0].to_owned() } else { format!("(either {})", names.join(" ")) }
    }

    fn predicate(&self, predicate: &Predicate) -> String {
        format!("({}{})", predicate.name, self.parameters(&predicate.parameters, " "))
    }

    /// `?x - t ?y - u`, after `before` unless it is empty.
    fn parameters(&self, parameters: &[Parameter], before: &str) -> String {
        let one = |parameter: &Parameter| format!("?{} - {}", parameter.name, self.types(&parameter.types));
        let parts: Vec<String> = parameters.iter().map(one).collect();
        if parts.is_empty() { String::new() } else { format!("{before}{}", parts.join(" ")) }
    }

    fn functions(&mut self) -> fmt::Result {
        let total = self.domain.has_total_cost.then(|| "(total-cost) - number".to_owned());
        let function = |one: &CostFunction| format!("({}{}) - number", one.name, self.parameters(&one.parameters, " "));
        let others: Vec<String> = self.domain.cost_functions.iter().map(function).collect();
        self.section(":functions", total.into_iter().chain(others))
    }

    fn axiom(&mut self, axiom: &Axiom) -> fmt::Result {
        let name = &self.domain.predicates[axiom.predicate.index()].name;
        let parameters = self.parameters(&axiom.parameters, " ");
        write!(self.out, "\n  (:derived ({name}{parameters})\n    ")?;
        self.within(&axiom.parameters, |printer| printer.condition(&axiom.condition))?;
        self.out.write_str(")")
    }

    fn action(&mut self, action: &Action) -> fmt::Result {
        let parameters = self.parameters(&action.parameters, "");
        write!(self.out, "\n  (:action {}\n    :parameters ({parameters})", action.name)?;
        self.within(&action.parameters, |printer| {
            printer.out.write_str("\n    :precondition ")?;
            printer.condition(&action.precondition)?;
            printer.out.write_str("\n    :effect ")?;
            printer.effect(&action.effect)
        })?;
        self.out.write_str(")")
    }

    /// Runs `print` with the parameters in scope.
    fn within(&mut self, parameters: &[Parameter], print: impl FnOnce(&mut Self) -> fmt::Result) -> fmt::Result {
        let outer = self.variables.len();
        self.variables.extend(parameters.iter().map(|parameter| format!("?{}", parameter.name)));
        print(self)?;
        self.variables.truncate(outer);
        Ok(())
    }

    fn condition(&mut self, condition: &Condition) -> fmt::Result {
        match condition {
            Condition::And(parts) => self.connective("and", parts, Self::condition),
            Condition::Or(parts) => self.connective("or", parts, Self::condition),
            Condition::Not(part) => self.connective("not", [&**part], Self::condition),
            Condition::Imply(premise, conclusion) => {
                self.connective("imply", [&**premise, conclusion], Self::condition)
            }
            Condition::Forall(parameters, body) => self.quantifier("forall", parameters, |p| p.condition(body)),
            Condition::Exists(parameters, body) => self.quantifier("exists", parameters, |p| p.condition(body)),
            Condition::Atom(atom) => self.atom(atom),
            Condition::Equals(left, right) => self.applied("=", &[*left, *right]),
        }
    }

    fn effect(&mut self, effect: &Effect) -> fmt::Result {
        match effect {
            Effect::And(parts) => self.connective("and", parts, Self::effect),
            Effect::Add(atom) => self.atom(atom),
            Effect::Delete(atom) => self.connective("not", [atom], Self::atom),
            Effect::When(condition, effect) => {
                self.out.write_str("(when ")?;
                self.condition(condition)?;
                self.out.write_str(" ")?;
                self.effect(effect)?;
                self.out.write_str(")")
            }
            Effect::Forall(parameters, body) => self.quantifier("forall", parameters, |p| p.effect(body)),
            Effect::IncreaseCost(cost) => self.cost(cost),
        }
    }

    fn connective<'x, T: 'x>(
        &mut self,
        name: &str,
        parts: impl IntoIterator<Item = &'x T>,
        print: fn(&mut Self, &T) -> fmt::Result,
    ) -> fmt::Result {
        write!(self.out, "({name}")?;
        for part in parts {
            self.out.write_str(" ")?;
            print(self, part)?;
        }
        self.out.write_str(")")
    }

    fn quantifier(
        &mut self,
        name: &str,
        parameters: &[Parameter],
        body: impl FnOnce(&mut Self) -> fmt::Result,
    ) -> fmt::Result {
        let list = self.parameters(parameters, "");
        write!(self.out, "({name} ({list}) ")?;
        self.within(parameters, body)?;
        self.out.write_str(")")
    }

    fn cost(&mut self, cost: &Cost) -> fmt::Result {
        self.out.write_str("(increase (total-cost) ")?;
        match cost {
            Cost::Number(value) => write!(self.out, "{value}")?,
            Cost::Function(function, terms) => {
                let domain = self.domain;
                self.applied(&domain.cost_functions[*function].name, terms)?;
            }
        }
        self.out.write_str(")")
    }

    fn atom(&mut self, atom: &Atom) -> fmt::Result {
        let domain = self.domain;
        self.applied(&domain.predicates[atom.predicate.index()].name, &atom.terms)
    }

    fn applied(&mut self, name: &str, terms: &[Term]) -> fmt::Result {
        write!(self.out, "({name}")?;
        for term in terms {
            match term {
                Term::Variable(id) => write!(self.out, " {}", self.variables[id.index()])?,
                Term::Object(id) => write!(self.out, " {}", self.objects[id.index()])?,
            }
        }
        self.out.write_str(")")
    }
}

fn kind_lines(kind: &Type, types: &[Type]) -> Vec<String> {
    kind.parents.iter().map(|parent| format!("{} - {}", kind.name, types[parent.index()].name)).collect()
}
