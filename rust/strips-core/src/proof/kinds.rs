//! Whether a negative is what its kind makes of the positive. Works on what the texts say, not on how they were drawn.

use crate::text::{ACTION, Completion, END, STATE, Step, TextAtom};

/// Whether `negative` can be made of `positive` as `kind` says. `followed` tells whether all of the negative's actions
/// apply and all of its states are true.
pub(super) fn is_made(kind: &str, positive: &Completion, negative: &Completion, followed: bool) -> bool {
    let (right, wrong) = (&positive.steps[..], &negative.steps[..]);
    match kind {
        "shuffle-actions" => same_states(right, wrong) && permuted(right, wrong, action),
        "shuffle-states" => same_actions(right, wrong) && permuted(right, wrong, state),
        "shuffle-both" => permuted(right, wrong, action) && permuted(right, wrong, state),
        "drop-step" => is_without_one(right, wrong),
        "repeat-step" => is_repeated(right, wrong),
        "swap-steps" => is_swapped(right, wrong),
        "wrong-argument" => same_states(right, wrong) && has_one_other_argument(right, wrong),
        "missing-atom" => same_actions(right, wrong) && lacks_one_atom(right, wrong),
        "invented-atom" => same_actions(right, wrong) && lacks_one_atom(wrong, right),
        "other-goal" => followed,
        "prefix" => right.starts_with(wrong) && wrong.len() < right.len(),
        _ => false,
    }
}

/// Whether the completion, read and printed again, is the same text.
pub(super) fn is_printed(completion: &Completion, text: &str) -> bool {
    let mut printed = String::with_capacity(text.len());
    for step in &completion.steps {
        printed.push_str(ACTION);
        printed.push(' ');
        print(&step.action, &mut printed);
        printed.push(' ');
        printed.push_str(STATE);
        for (place, atom) in step.state.iter().flatten().enumerate() {
            printed.push_str(if place == 0 { " " } else { ", " });
            print(atom, &mut printed);
        }
        printed.push(' ');
    }
    printed.push_str(END);
    printed == text
}

fn print(atom: &TextAtom<'_>, out: &mut String) {
    out.push_str(atom.name);
    out.push('(');
    for (place, arg) in atom.args.iter().enumerate() {
        out.push_str(if place == 0 { "" } else { ", " });
        out.push_str(arg);
    }
    out.push(')');
}

fn action<'s, 'a>(step: &'s Step<'a>) -> Vec<&'s TextAtom<'a>> {
    vec![&step.action]
}

fn state<'s, 'a>(step: &'s Step<'a>) -> Vec<&'s TextAtom<'a>> {
    step.state.iter().flatten().collect()
}

fn same_actions(right: &[Step], wrong: &[Step]) -> bool {
    right.len() == wrong.len() && right.iter().zip(wrong).all(|(right, wrong)| right.action == wrong.action)
}

fn same_states(right: &[Step], wrong: &[Step]) -> bool {
    right.len() == wrong.len() && right.iter().zip(wrong).all(|(right, wrong)| right.state == wrong.state)
}

/// Whether both have the same parts, as multisets.
fn permuted<'s, 'a>(
    right: &'s [Step<'a>],
    wrong: &'s [Step<'a>],
    part: fn(&'s Step<'a>) -> Vec<&'s TextAtom<'a>>,
) -> bool {
    let sorted = |steps: &'s [Step<'a>]| {
        let mut parts: Vec<_> = steps.iter().map(part).collect();
        parts.sort_unstable();
        parts
    };
    sorted(right) == sorted(wrong)
}

/// Whether `shorter` is `longer` without one of its steps.
fn is_without_one(longer: &[Step], shorter: &[Step]) -> bool {
    longer.len() == shorter.len() + 1
        && (0..longer.len()).any(|at| longer[..at] == shorter[..at] && longer[at + 1..] == shorter[at..])
}

/// Whether one step of `right` stands twice in a row in `wrong`.
fn is_repeated(right: &[Step], wrong: &[Step]) -> bool {
    wrong.len() == right.len() + 1
        && (0..right.len()).any(|at| wrong[..=at] == right[..=at] && wrong[at + 1..] == right[at..])
}

fn is_swapped(right: &[Step], wrong: &[Step]) -> bool {
    let differing: Vec<usize> = (0..right.len().min(wrong.len())).filter(|&at| right[at] != wrong[at]).collect();
    match differing[..] {
        [first, second] => right.len() == wrong.len() && right[first] == wrong[second] && right[second] == wrong[first],
        _ => false,
    }
}

fn has_one_other_argument(right: &[Step], wrong: &[Step]) -> bool {
    let differences = |(right, wrong): (&Step, &Step)| {
        let (right, wrong) = (&right.action, &wrong.action);
        let comparable = right.name == wrong.name && right.args.len() == wrong.args.len();
        let differing = right.args.iter().zip(&wrong.args).filter(|(right, wrong)| right != wrong).count();
        if comparable { differing } else { usize::MAX / 1024 }
    };
    right.iter().zip(wrong).map(differences).sum::<usize>() == 1
}

/// Whether exactly one state of `less` lacks exactly one atom of the same state of `more`, all else being equal.
fn lacks_one_atom(more: &[Step], less: &[Step]) -> bool {
    let differing: Vec<usize> = (0..more.len()).filter(|&at| more[at].state != less[at].state).collect();
    let [at] = differing[..] else { return false };
    let (more, less) = (state(&more[at]), state(&less[at]));
    more.len() == less.len() + 1
        && (0..more.len()).any(|gone| more[..gone] == less[..gone] && more[gone + 1..] == less[gone..])
}
