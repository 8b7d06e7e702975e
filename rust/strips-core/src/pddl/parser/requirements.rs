//! Which parts of PDDL a text uses, and which its `:requirements` declare.

use super::super::ast::Warning;
use super::super::error::Fault;
use super::super::tree::Items;
use crate::span::Span;

/// A part of PDDL that a requirement flag stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Feature {
    Typing,
    Equality,
    NegativePreconditions,
    DisjunctivePreconditions,
    ExistentialPreconditions,
    UniversalPreconditions,
    ConditionalEffects,
    DerivedPredicates,
    ActionCosts,
}

const FLAGS: [(Feature, &str); 9] = [
    (Feature::Typing, "typing"),
    (Feature::Equality, "equality"),
    (Feature::NegativePreconditions, "negative-preconditions"),
    (Feature::DisjunctivePreconditions, "disjunctive-preconditions"),
    (Feature::ExistentialPreconditions, "existential-preconditions"),
    (Feature::UniversalPreconditions, "universal-preconditions"),
    (Feature::ConditionalEffects, "conditional-effects"),
    (Feature::DerivedPredicates, "derived-predicates"),
    (Feature::ActionCosts, "action-costs"),
];

/// Flags of what lies outside classical planning: harmless to declare, refused where used.
const OUTSIDE: [&str; 9] = [
    "fluents",
    "numeric-fluents",
    "object-fluents",
    "durative-actions",
    "duration-inequalities",
    "continuous-effects",
    "timed-initial-literals",
    "preferences",
    "constraints",
];

/// The first use of each feature.
#[derive(Clone, Default)]
pub(super) struct Uses([Option<Span>; FLAGS.len()]);

impl Uses {
    pub(super) fn note(&mut self, feature: Feature, span: Span) {
        self.0[feature as usize].get_or_insert(span);
    }

    /// A warning for each feature that is used and not among the declared flags.
    pub(super) fn undeclared(&self, flags: &[String]) -> Vec<Warning> {
        let covered = |feature| flags.iter().any(|flag| covers(flag, feature));
        let uses = FLAGS.iter().zip(&self.0).filter_map(|(&(feature, flag), use_)| Some((feature, flag, (*use_)?)));
        uses.filter(|&(feature, ..)| !covered(feature))
            .map(|(_, flag, span)| Warning { message: format!("`:{flag}` is used but not declared"), span })
            .collect()
    }
}

fn covers(flag: &str, feature: Feature) -> bool {
    let quantified = matches!(feature, Feature::ExistentialPreconditions | Feature::UniversalPreconditions);
    match flag {
        "adl" | "ucpop" => !matches!(feature, Feature::DerivedPredicates | Feature::ActionCosts),
        "quantified-preconditions" => quantified,
        "domain-axioms" => feature == Feature::DerivedPredicates,
        "fluents" | "numeric-fluents" => feature == Feature::ActionCosts,
        _ => FLAGS[feature as usize].1 == flag,
    }
}

/// The flags of a `(:requirements …)` section, without their colons, and warnings about those that mean nothing here.
pub(super) fn flags(section: Items) -> Result<(Vec<String>, Vec<Warning>), Fault> {
    let (mut flags, mut warnings) = (Vec::new(), Vec::new());
    for item in section {
        let flag = item.name("a requirement such as `:typing`")?;
        let flag = flag.strip_prefix(':').ok_or_else(|| item.unexpected("a requirement such as `:typing`"))?;
        let message = match flag {
            _ if OUTSIDE.contains(&flag) => Some(format!("`:{flag}` is not supported; fine as long as it is not used")),
            _ if is_known(flag) => None,
            _ => Some(format!("unknown requirement `:{flag}`")),
        };
        warnings.extend(message.map(|message| Warning { message, span: item.span() }));
        flags.push(flag.to_owned());
    }
    Ok((flags, warnings))
}

fn is_known(flag: &str) -> bool {
    let wide = ["strips", "adl", "ucpop", "quantified-preconditions", "domain-axioms"];
    wide.contains(&flag) || FLAGS.iter().any(|&(_, name)| name == flag)
}
