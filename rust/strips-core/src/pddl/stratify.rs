//! Whether derived predicates can be computed stratum by stratum: none may depend on its own negation.

use super::ast::{Axiom, Condition, Predicate, PredicateId};
use super::error::{Fault, PddlErrorKind};

/// The stratum of each predicate; 0 for those that no rule defines.
///
/// A head lies no lower than the derived predicates of its body, and above those that stand there under a negation.
/// An error, the number of a rule on the cycle, if the rules allow no such numbering. Quadratic in the number of derived predicates at worst.
pub(crate) fn strata(predicates: &[Predicate], axioms: &[Axiom]) -> Result<Vec<usize>, usize> {
    let derived = predicates.iter().filter(|predicate| predicate.derived).count();
    let edges: Vec<_> = axioms.iter().enumerate().flat_map(|(index, axiom)| edges(index, axiom)).collect();
    let mut stratum = vec![0; predicates.len()];
    loop {
        let mut changed = false;
        for &(index, body, negated) in &edges {
            let head = axioms[index].predicate.index();
            let least = stratum[body.index()] + usize::from(negated);
            if predicates[body.index()].derived && stratum[head] < least {
                if least > derived {
                    return Err(index);
                }
                stratum[head] = least;
                changed = true;
            }
        }
        if !changed {
            return Ok(stratum);
        }
    }
}

/// An error at a rule on the cycle unless the rules are stratified.
pub(super) fn check(predicates: &[Predicate], axioms: &[Axiom]) -> Result<(), Fault> {
    let unstratified = |index: usize| {
        let name = predicates[axioms[index].predicate.index()].name.clone();
        Fault::new(PddlErrorKind::NotStratified { name }, axioms[index].span)
    };
    strata(predicates, axioms).map(|_| ()).map_err(unstratified)
}

/// (axiom, predicate in its body, whether under a negation).
fn edges(index: usize, axiom: &Axiom) -> Vec<(usize, PredicateId, bool)> {
    let mut found = Vec::new();
    collect(&axiom.condition, false, &mut |predicate, negated| found.push((index, predicate, negated)));
    found
}

fn collect(condition: &Condition, negated: bool, found: &mut impl FnMut(PredicateId, bool)) {
    match condition {
        Condition::And(parts) | Condition::Or(parts) => parts.iter().for_each(|part| collect(part, negated, found)),
        Condition::Not(part) => collect(part, !negated, found),
        Condition::Imply(premise, conclusion) => {
            collect(premise, !negated, found);
            collect(conclusion, negated, found);
        }
        Condition::Forall(_, body) | Condition::Exists(_, body) => collect(body, negated, found),
        Condition::Atom(atom) => found(atom.predicate, negated),
        Condition::Equals(..) => {}
    }
}
