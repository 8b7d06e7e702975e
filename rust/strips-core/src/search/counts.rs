//! Exact numbers of plans from each node of a plan graph, in machine words where they fit.
//!
//! The same table is filled with 64-bit, 128-bit or big numbers, the first that does not overflow. Ranks, draws and
//! distributions are read off it.

use std::ops::Range;

use num_bigint::BigUint;
use num_traits::{CheckedAdd, One, ToPrimitive, Zero};
use rayon::prelude::*;

use super::plan_graph::{Live, PlanGraph, WalkGraph};
use crate::task::{LimitError, Watch};

/// A number of plans.
pub(super) trait Count:
    Clone + Send + Sync + PartialOrd + Zero + One + CheckedAdd + for<'a> std::ops::SubAssign<&'a Self>
{
    /// From a big number, if it fits.
    fn from_big(big: &BigUint) -> Option<Self>;
    /// As a big number.
    fn to_big(&self) -> BigUint;
}

impl Count for u64 {
    fn from_big(big: &BigUint) -> Option<Self> {
        big.to_u64()
    }
    fn to_big(&self) -> BigUint {
        BigUint::from(*self)
    }
}

impl Count for u128 {
    fn from_big(big: &BigUint) -> Option<Self> {
        big.to_u128()
    }
    fn to_big(&self) -> BigUint {
        BigUint::from(*self)
    }
}

impl Count for BigUint {
    fn from_big(big: &BigUint) -> Option<Self> {
        Some(big.clone())
    }
    fn to_big(&self) -> BigUint {
        self.clone()
    }
}

/// The plans from each node: for graphs of walks one column for each number of steps, for graphs of simple plans one
/// column in all, as a node there knows its steps.
#[derive(Clone, Debug)]
pub(super) struct Columns<C> {
    columns: Vec<Vec<C>>,
    by_steps: bool,
}

/// A table with numbers as wide as they need to be.
#[derive(Clone, Debug)]
pub(super) enum Table {
    Short(Columns<u64>),
    Long(Columns<u128>),
    Big(Columns<BigUint>),
}

/// Runs the same code on a table of any width.
macro_rules! with_columns {
    ($table:expr, $columns:ident => $body:expr) => {
        match $table {
            $crate::search::counts::Table::Short($columns) => $body,
            $crate::search::counts::Table::Long($columns) => $body,
            $crate::search::counts::Table::Big($columns) => $body,
        }
    };
}
pub(super) use with_columns;

impl Table {
    /// Counts the walks of each number of steps up to the horizon.
    pub fn of_walks(walks: &WalkGraph, watch: &Watch) -> Result<Self, LimitError> {
        if let Some(columns) = count_walks(walks, watch)? {
            return Ok(Self::Short(columns));
        }
        if let Some(columns) = count_walks(walks, watch)? {
            return Ok(Self::Long(columns));
        }
        Ok(Self::Big(count_walks(walks, watch)?.expect("big numbers do not overflow")))
    }

    /// Counts the plans from each node of a graph whose nodes follow their targets.
    pub fn of_nodes(graph: &PlanGraph, goals: usize, watch: &Watch) -> Result<Self, LimitError> {
        if let Some(columns) = count_nodes(graph, goals, watch)? {
            return Ok(Self::Short(columns));
        }
        if let Some(columns) = count_nodes(graph, goals, watch)? {
            return Ok(Self::Long(columns));
        }
        Ok(Self::Big(count_nodes(graph, goals, watch)?.expect("big numbers do not overflow")))
    }

    /// Plans of exactly `steps` steps from a node.
    pub fn get(&self, node: u32, steps: usize) -> BigUint {
        with_columns!(self, columns => columns.get(node, steps).to_big())
    }

    /// Which counts are not zero, for the enumeration, which asks nothing else.
    pub fn live(&self) -> Live {
        with_columns!(self, columns => columns.live())
    }
}

impl<C: Count> Columns<C> {
    /// Plans of exactly `steps` steps from a node.
    #[inline]
    pub fn get(&self, node: u32, steps: usize) -> &C {
        &self.columns[if self.by_steps { steps } else { 0 }][node as usize]
    }

    fn live(&self) -> Live {
        if !self.by_steps {
            return Live::Everywhere;
        }
        let bits = |chunk: &[C]| {
            chunk.iter().enumerate().fold(0, |bits, (at, count)| bits | u64::from(!count.is_zero()) << at)
        };
        Live::Bits(self.columns.iter().map(|column| column.chunks(64).map(bits).collect()).collect())
    }
}

/// Fills the columns by rising number of steps; nothing if a number does not fit.
fn count_walks<C: Count>(walks: &WalkGraph, watch: &Watch) -> Result<Option<Columns<C>>, LimitError> {
    let goal = |&distance: &u32| if distance == 0 { C::one() } else { C::zero() };
    let mut columns: Vec<Vec<C>> = vec![walks.distances[..walks.width(0)].iter().map(goal).collect()];
    let mut cells = columns[0].len();
    for steps in 1..=walks.horizon {
        watch.check()?;
        let width = walks.width(steps);
        cells += width;
        watch.bytes(walks.graph.bytes() + cells * size_of::<C>())?;
        let mut column = Vec::with_capacity(width);
        while column.len() < width {
            watch.check()?;
            let nodes = column.len()..width.min(column.len() + NODES);
            match count_more(&walks.graph, &columns[steps - 1], nodes) {
                Some(counts) => column.extend(counts),
                None => return Ok(None),
            }
        }
        columns.push(column);
    }
    Ok(Some(Columns { columns, by_steps: true }))
}

/// Nodes whose counts are computed between two looks at the clock.
const NODES: usize = 1 << 20;

/// One more step for some of the nodes.
fn count_more<C: Count>(graph: &PlanGraph, shorter: &[C], nodes: Range<usize>) -> Option<Vec<C>> {
    let count = |node: u32| total(graph, node, shorter);
    let nodes = nodes.start as u32..nodes.end as u32;
    if nodes.len() < 4096 { nodes.map(count).collect() } else { nodes.into_par_iter().map(count).collect() }
}

/// The sum over a node's edges; nothing if it does not fit.
#[inline]
fn total<C: Count>(graph: &PlanGraph, node: u32, counts: &[C]) -> Option<C> {
    let edges = &graph.edges[graph.edges_of(node)];
    edges.iter().try_fold(C::zero(), |sum, edge| sum.checked_add(&counts[edge.target as usize]))
}

/// One column for a graph whose first `goals` nodes are goals and whose nodes come after their targets.
fn count_nodes<C: Count>(graph: &PlanGraph, goals: usize, watch: &Watch) -> Result<Option<Columns<C>>, LimitError> {
    let mut counts = vec![C::one(); goals];
    for node in goals as u32..graph.ends.len() as u32 {
        if node % 65_536 == 0 {
            watch.check()?;
        }
        match total(graph, node, &counts) {
            Some(count) => counts.push(count),
            None => return Ok(None),
        }
    }
    Ok(Some(Columns { columns: vec![counts], by_steps: false }))
}
