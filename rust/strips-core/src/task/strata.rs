//! In which order derived predicates are computed.

use super::normal::Normal;

/// One derived predicate's rule, as far as the order matters.
pub(super) struct Dependency<'a> {
    pub head: usize,
    pub condition: &'a Normal,
}

/// The stratum of each of the `predicates`: not below those it depends on, and above those it depends on negatively.
///
/// The parser refuses domains in which a predicate depends on its own negation; for such a domain the strata are cut
/// off at the number of predicates.
pub(super) fn strata(predicates: usize, derived: &[bool], dependencies: &[Dependency]) -> Vec<usize> {
    let mut stratum = vec![0; predicates];
    let mut changed = true;
    while changed {
        changed = false;
        for Dependency { head, condition } in dependencies {
            let mut needed = stratum[*head];
            condition.literals(&mut |atom, wanted| {
                if derived[atom.relation] {
                    needed = needed.max(stratum[atom.relation] + usize::from(!wanted));
                }
            });
            if needed > stratum[*head] && needed <= predicates {
                stratum[*head] = needed;
                changed = true;
            }
        }
    }
    stratum
}
