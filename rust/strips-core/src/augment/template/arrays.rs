//! Arrays: as many objects as asked for, in a row or a grid, and what is true of each and of neighbours.

use super::Form;
use crate::pddl::ast::TypeId;

/// Objects of one type in a grid of any number of dimensions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    pub type_id: TypeId,
    /// How many there are along each dimension.
    pub sizes: Vec<usize>,
    pub rules: Vec<Rule>,
}

/// Forms that are placed for some of the array's objects.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rule {
    pub of: Relation,
    pub forms: Vec<Form>,
}

/// Of which objects of an array a rule speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// Of each.
    Each,
    /// Of the first.
    First,
    /// Of the last.
    Last,
    /// Of each two, the earlier first.
    Pairs,
    /// Of each two that are next to each other along one dimension, the earlier first.
    Neighbours,
}

impl Relation {
    /// The relation of that name, and of how many objects it speaks at a time.
    pub fn of_name(name: &str) -> Option<(Self, usize)> {
        match name {
            "each" => Some((Self::Each, 1)),
            "first" => Some((Self::First, 1)),
            "last" => Some((Self::Last, 1)),
            "pairs" => Some((Self::Pairs, 2)),
            "neighbours" => Some((Self::Neighbours, 2)),
            _ => None,
        }
    }

    /// The positions that a rule of this relation is placed for, one tuple after the other.
    pub fn positions(self, sizes: &[usize]) -> Vec<Vec<usize>> {
        let count: usize = sizes.iter().product();
        match self {
            Self::Each => (0..count).map(|at| vec![at]).collect(),
            Self::First => vec![vec![0]],
            Self::Last => vec![vec![count - 1]],
            Self::Pairs => (0..count).flat_map(|a| (a + 1..count).map(move |b| vec![a, b])).collect(),
            Self::Neighbours => (0..count).flat_map(|at| next(at, sizes)).collect(),
        }
    }
}

/// The position with each one that comes after it along one dimension, the last dimension first.
fn next(at: usize, sizes: &[usize]) -> Vec<Vec<usize>> {
    let mut step = 1;
    let mut found = Vec::new();
    for &size in sizes.iter().rev() {
        if at / step % size + 1 < size {
            found.push(vec![at, at + step]);
        }
        step *= size;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ_by_one_along_one_dimension() {
        let grid = Relation::Neighbours.positions(&[2, 3]);
        assert_eq!(grid, [[0, 1], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [4, 5]]);
        assert_eq!(Relation::Neighbours.positions(&[3]), [[0, 1], [1, 2]]);
    }

    #[test]
    fn pairs_are_each_two_in_order() {
        assert_eq!(Relation::Pairs.positions(&[3]), [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(
            (Relation::First.positions(&[2, 2]), Relation::Last.positions(&[2, 2])),
            (vec![vec![0]], vec![vec![3]])
        );
    }
}
