//! The states within reach of one initial state, layer by layer, with every shortest path to each.
//!
//! A problem's goal is read off many times from one exploration (a random initial state gives many goals), which
//! [`PlanSet`](crate::search::PlanSet), made for one goal, would explore anew. Holds the states, a table of them, and
//! one entry for each operator that leads from one layer into the next.

use rustc_hash::FxHashMap;

use crate::random::Random;
use crate::search::SuccessorGenerator;
use crate::task::{LimitError, Limits, OperatorId, State, Task, Watch};

/// How many states pass between two looks at whether somebody interrupted.
const STATES_PER_CHECK: usize = 256;

/// Where an edge comes from.
#[derive(Clone, Copy, Debug)]
struct Edge {
    parent: u32,
    operator: OperatorId,
}

/// States by distance from the initial one.
pub(super) struct Exploration {
    pub states: Vec<State>,
    /// Where each layer begins in `states`, and where the last ends.
    layers: Vec<usize>,
    /// Where each state's edges end in `edges`.
    ends: Vec<u32>,
    edges: Vec<Edge>,
    /// How many shortest paths lead to each state.
    paths: Vec<u128>,
}

impl Exploration {
    /// Explores until the layer that holds a state for which `stop` is true, `horizon` steps or `most` states,
    /// whichever comes first. Layers are whole, so the last one may pass `most` by far.
    ///
    /// # Errors
    /// When the work is interrupted.
    pub fn new(
        task: &Task,
        (horizon, most): (usize, usize),
        stop: impl Fn(&State) -> bool,
        limits: &Limits,
    ) -> Result<Self, LimitError> {
        let watch = limits.start();
        let generator = SuccessorGenerator::new(task);
        let mut found = Growing::new(task.init.clone());
        while found.layers.len() <= horizon && found.states.len() < most {
            let last = found.layers[found.layers.len() - 1]..found.states.len();
            if last.is_empty() || found.states[last.clone()].iter().any(&stop) {
                break;
            }
            found.grow(&generator, last, &watch)?;
        }
        Ok(found.finish())
    }

    /// Steps to the farthest state.
    pub fn depth(&self) -> usize {
        self.layers.len() - 2
    }

    /// The states whose shortest path has that many steps.
    pub fn layer(&self, depth: usize) -> std::ops::Range<usize> {
        self.layers[depth]..self.layers[depth + 1]
    }

    /// Steps of a shortest path to the state.
    pub fn depth_of(&self, state: usize) -> usize {
        self.layers.partition_point(|&first| first <= state) - 1
    }

    /// The states of the nearest layer that satisfy `goal`, and its distance.
    pub fn nearest(&self, goal: impl Fn(&State) -> bool) -> Option<(usize, Vec<usize>)> {
        (0..=self.depth()).find_map(|depth| {
            let found: Vec<usize> = self.layer(depth).filter(|&state| goal(&self.states[state])).collect();
            (!found.is_empty()).then_some((depth, found))
        })
    }

    /// How many shortest paths lead to the states, which must be of one layer.
    pub fn count(&self, states: &[usize]) -> u128 {
        states.iter().map(|&state| self.paths[state]).sum()
    }

    /// Every shortest plan to the states where there are at most `most`, else as many drawn uniformly, each once.
    pub fn shortest_plans(&self, states: &[usize], most: usize, random: &mut Random) -> Vec<Vec<OperatorId>> {
        let mut plans = Vec::new();
        if self.count(states) <= most as u128 {
            for &state in states {
                self.list(state, &mut Vec::new(), &mut plans);
            }
        } else {
            plans.extend((0..most).map(|_| self.draw(states, random)));
        }
        plans.sort_unstable();
        plans.dedup();
        plans
    }

    fn edges_of(&self, state: usize) -> &[Edge] {
        let start = if state == 0 { 0 } else { self.ends[state - 1] };
        &self.edges[start as usize..self.ends[state] as usize]
    }

    /// Follows edges back from `state`; `after` holds the operators that follow, the last first.
    fn list(&self, state: usize, after: &mut Vec<OperatorId>, plans: &mut Vec<Vec<OperatorId>>) {
        if state == 0 {
            plans.push(after.iter().rev().copied().collect());
        }
        for edge in self.edges_of(state) {
            after.push(edge.operator);
            self.list(edge.parent as usize, after, plans);
            after.pop();
        }
    }

    /// One plan, each as likely as any other: at each state back, an edge by the number of paths that come in by it.
    fn draw(&self, states: &[usize], random: &mut Random) -> Vec<OperatorId> {
        let mut state = states[Self::weighted(states.iter().map(|&state| self.paths[state]), random)];
        let mut plan = Vec::new();
        while state != 0 {
            let edges = self.edges_of(state);
            let chosen = edges[Self::weighted(edges.iter().map(|edge| self.paths[edge.parent as usize]), random)];
            plan.push(chosen.operator);
            state = chosen.parent as usize;
        }
        plan.reverse();
        plan
    }

    fn weighted(weights: impl Iterator<Item = u128> + Clone, random: &mut Random) -> usize {
        let total: u128 = weights.clone().sum();
        let drawn = random.below_big(&total.into());
        let mut left = u128::try_from(drawn).expect("less than the total");
        for (index, weight) in weights.enumerate() {
            if left < weight {
                return index;
            }
            left -= weight;
        }
        unreachable!("the draw is below the total")
    }
}

/// An exploration in the making: edges in the order they are met.
struct Growing {
    states: Vec<State>,
    numbers: FxHashMap<State, u32>,
    layers: Vec<usize>,
    edges: Vec<(u32, Edge)>,
}

impl Growing {
    fn new(init: State) -> Self {
        let numbers = FxHashMap::from_iter([(init.clone(), 0)]);
        Self { states: vec![init], numbers, layers: vec![0], edges: Vec::new() }
    }

    fn grow(
        &mut self,
        generator: &SuccessorGenerator,
        last: std::ops::Range<usize>,
        watch: &Watch,
    ) -> Result<(), LimitError> {
        let first_new = self.states.len();
        self.layers.push(first_new);
        let (mut next, mut applicable) = (self.states[0].clone(), Vec::new());
        for parent in last {
            if parent.is_multiple_of(STATES_PER_CHECK) {
                watch.check()?;
            }
            let state = self.states[parent].clone();
            generator.applicable_in(&state.0, &mut applicable);
            for &operator in &applicable {
                next.0.copy_from_slice(&state.0);
                generator.apply(operator, &state.0, &mut next.0);
                let number = self.number(&next);
                if number as usize >= first_new {
                    self.edges.push((number, Edge { parent: parent as u32, operator: OperatorId(operator) }));
                }
            }
        }
        Ok(())
    }

    fn number(&mut self, state: &State) -> u32 {
        if let Some(&number) = self.numbers.get(state) {
            return number;
        }
        let number = self.states.len() as u32;
        self.numbers.insert(state.clone(), number);
        self.states.push(state.clone());
        number
    }

    fn finish(mut self) -> Exploration {
        if self.layers[self.layers.len() - 1] == self.states.len() {
            self.layers.pop();
        }
        self.layers.push(self.states.len());
        let mut ends = vec![0u32; self.states.len()];
        self.edges.iter().for_each(|&(target, _)| ends[target as usize] += 1);
        (1..ends.len()).for_each(|state| ends[state] += ends[state - 1]);
        let mut edges = self.edges.iter().map(|&(_, edge)| edge).collect::<Vec<_>>();
        let mut free = ends.clone();
        for &(target, edge) in self.edges.iter().rev() {
            free[target as usize] -= 1;
            edges[free[target as usize] as usize] = edge;
        }
        let mut exploration = Exploration { states: self.states, layers: self.layers, ends, edges, paths: vec![1] };
        for state in 1..exploration.states.len() {
            let into = exploration.edges_of(state).iter().map(|edge| exploration.paths[edge.parent as usize]);
            let count = into.fold(0u128, u128::saturating_add);
            exploration.paths.push(count);
        }
        exploration
    }
}
