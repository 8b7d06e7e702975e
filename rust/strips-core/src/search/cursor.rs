//! Walking through the plans of one length in lexicographic order, from any plan on.
//!
//! Holds one edge position a step and nothing else, so a walk of any length needs memory for one plan.

use super::counts::{Columns, Count};
use super::plan_graph::PlanGraph;

/// A plan of one length, and how to get to the next one.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'a> {
    graph: &'a PlanGraph,
    /// The edge taken at each step, as its position in the graph's edges.
    at: Vec<usize>,
    /// Where the edges to choose from at each step end.
    ends: Vec<usize>,
    /// The operators of those edges.
    operators: Vec<u32>,
}

impl<'a> Cursor<'a> {
    /// The first plan of a length, if there is one.
    pub fn first(graph: &'a PlanGraph, length: usize) -> Option<Self> {
        let root = graph.roots[length]?;
        let mut cursor = Self::blank(graph, length);
        cursor.descend(root, 0);
        Some(cursor)
    }

    /// The plan with this rank among those of its length, which must have more plans than that.
    pub fn at_rank<C: Count>(graph: &'a PlanGraph, counts: &Columns<C>, length: usize, mut rank: C) -> Self {
        let mut cursor = Self::blank(graph, length);
        let mut node = graph.roots[length].expect("a length with plans has a root");
        for step in 0..length {
            let edges = graph.edges_of(node);
            cursor.ends[step] = edges.end;
            let edge = pick(graph, counts, edges, length - step - 1, &mut rank);
            cursor.take(step, edge);
            node = graph.edges[edge].target;
        }
        cursor
    }

    fn blank(graph: &'a PlanGraph, length: usize) -> Self {
        Self { graph, at: vec![0; length], ends: vec![0; length], operators: vec![0; length] }
    }

    /// The plan at hand.
    pub fn operators(&self) -> &[u32] {
        &self.operators
    }

    /// Moves to the next plan; false, and spent, after the last one.
    pub fn advance(&mut self) -> bool {
        (0..self.at.len()).rev().any(|step| self.advance_at(step))
    }

    /// Copies plans from this one on, a row of `length` operators each, and moves past them. `rows` must be a multiple
    /// of the length, and as many plans must be left.
    pub fn fill(&mut self, rows: &mut [u32]) {
        let length = self.at.len();
        if length == 0 {
            return;
        }
        let mut rows = rows.chunks_exact_mut(length);
        while let Some(row) = rows.next() {
            row.copy_from_slice(&self.operators);
            let full = self.fill_siblings(&mut rows);
            if full || !(0..length - 1).rev().any(|step| self.advance_at(step)) {
                return;
            }
        }
    }

    /// Copies the plans after this one that differ from it in the last step alone; true, and at the first that found
    /// no room, if the rows ran out before.
    #[inline]
    fn fill_siblings(&mut self, rows: &mut std::slice::ChunksExactMut<u32>) -> bool {
        let last = self.at.len() - 1;
        for position in self.at[last] + 1..self.ends[last] {
            let edge = self.graph.edges[position];
            if self.graph.is_live(edge.target, 0) {
                let Some(row) = rows.next() else {
                    self.take(last, position);
                    return true;
                };
                row[..last].copy_from_slice(&self.operators[..last]);
                row[last] = edge.operator;
            }
        }
        false
    }

    /// Takes the next edge at one step and the first ones after it, if there is a next one.
    #[inline]
    fn advance_at(&mut self, step: usize) -> bool {
        let left = self.at.len() - step - 1;
        match self.next_live(self.at[step] + 1, self.ends[step], left) {
            Some(edge) => {
                self.take(step, edge);
                self.descend(self.graph.edges[edge].target, step + 1);
                true
            }
            None => false,
        }
    }

    /// Takes the first edges from a node on, at this step and all after it.
    #[inline]
    fn descend(&mut self, mut node: u32, step: usize) {
        let length = self.at.len();
        for step in step..length {
            let edges = self.graph.edges_of(node);
            self.ends[step] = edges.end;
            let edge = self.next_live(edges.start, edges.end, length - step - 1);
            self.take(step, edge.expect("a live node has a live edge"));
            node = self.graph.edges[self.at[step]].target;
        }
    }

    #[inline]
    fn next_live(&self, first: usize, end: usize, left: usize) -> Option<usize> {
        (first..end).find(|&edge| self.graph.is_live(self.graph.edges[edge].target, left))
    }

    #[inline]
    fn take(&mut self, step: usize, edge: usize) {
        self.at[step] = edge;
        self.operators[step] = self.graph.edges[edge].operator;
    }
}

/// The edge whose plans hold the rank, which is made relative to them.
#[inline]
pub(super) fn pick<C: Count>(
    graph: &PlanGraph,
    counts: &Columns<C>,
    edges: std::ops::Range<usize>,
    left: usize,
    rank: &mut C,
) -> usize {
    for edge in edges {
        let plans = counts.get(graph.edges[edge].target, left);
        if *rank < *plans {
            return edge;
        }
        *rank -= plans;
    }
    unreachable!("the rank is below the number of plans")
}
