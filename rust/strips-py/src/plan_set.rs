//! `PlanSet`: all plans of a task up to a horizon, as a Python sequence; `Plans`: some of them, as flat arrays.

use std::ops::Range;
use std::sync::Arc;

use num_bigint::{BigInt, BigUint, Sign};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PySlice, PyTuple};
use strips_core::search::{self, Plan, SampleError, Semantics};
use strips_core::task::{LimitError, Limits, OperatorId};

use crate::interrupt;
use crate::operators::{OperatorNames, Step};

/// Plans that iteration asks the set for at a time.
const CHUNK: u32 = 1 << 12;

/// The semantics of that name.
pub fn semantics_of(name: &str) -> PyResult<Semantics> {
    let unknown = || PyValueError::new_err(format!("semantics must be first-goal, any or simple, not {name:?}"));
    Semantics::from_name(name).ok_or_else(unknown)
}

/// All plans of at most `max_steps` steps, shorter ones first, then in the order of their operators.
///
/// A plan is a tuple of operator names; `plans[i]` finds one by its rank, in time linear in its length.
#[pyclass(frozen, sequence, module = "strips_lm._native")]
pub struct PlanSet {
    names: Arc<OperatorNames>,
    core: Arc<search::PlanSet>,
}

impl PlanSet {
    pub fn new(names: Arc<OperatorNames>, core: search::PlanSet) -> Self {
        Self { names, core: Arc::new(core) }
    }

    fn batch(&self, py: Python<'_>, plans: search::Plans) -> PyResult<Plans> {
        batch(py, &self.names, &self.core, plans)
    }

    fn flat(&self, py: Python<'_>, range: Range<BigUint>) -> PyResult<search::Plans> {
        interrupt::run(py, &Limits::default(), |limits| self.core.plans_flat(range, limits))
    }

    fn plan(&self, steps: Vec<Step>) -> PyResult<Option<Plan>> {
        let ids: Option<Vec<OperatorId>> =
            steps.into_iter().map(|step| self.names.id(step)).collect::<PyResult<_>>()?;
        Ok(ids.map(Plan))
    }
}

#[pymethods]
impl PlanSet {
    /// The longest plan's steps.
    #[getter]
    fn max_steps(&self) -> usize {
        self.core.horizon()
    }

    /// Which sequences count as plans.
    #[getter]
    fn semantics(&self) -> &'static str {
        self.core.semantics().name()
    }

    /// How many plans there are; exact at any size, where `len` is limited to what an index can hold.
    fn count(&self) -> BigUint {
        self.core.count()
    }

    /// How many plans there are of each length, from 0 to `max_steps`.
    fn counts(&self) -> Vec<BigUint> {
        self.core.counts().to_vec()
    }

    fn __len__(&self) -> PyResult<usize> {
        let too_many = |_| pyo3::exceptions::PyOverflowError::new_err("more plans than an index can hold: use count()");
        usize::try_from(self.core.count()).map_err(too_many)
    }

    fn __bool__(&self) -> bool {
        !self.core.is_empty()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        if let Ok(slice) = index.cast::<PySlice>() {
            let plans = match Ranks::of(slice, &self.core.count())? {
                Ranks { start, stop, step } if step == BigInt::from(1) => {
                    self.flat(py, natural(start)..natural(stop))?
                }
                ranks => {
                    interrupt::run(py, &Limits::default(), |limits| self.core.plans_at(&ranks.list(limits)?, limits))?
                }
            };
            return Ok(self.batch(py, plans)?.into_pyobject(py)?.into_any());
        }
        let rank = from_start(index.extract()?, &self.core.count());
        let plan = rank.to_biguint().and_then(|rank| self.core.unrank(&rank));
        let plan = plan.ok_or_else(|| PyIndexError::new_err("there are not as many plans"))?;
        Ok(self.names.plan(py, plan.0.iter().map(|operator| operator.0))?.into_any())
    }

    fn __iter__(&self) -> PlanIterator {
        let set = PlanSet { names: self.names.clone(), core: self.core.clone() };
        PlanIterator {
            set,
            next: BigUint::ZERO,
            chunk: search::Plans { operators: Vec::new(), offsets: vec![0] },
            at: 0,
        }
    }

    fn __contains__(&self, plan: Vec<Step>) -> PyResult<bool> {
        Ok(self.rank(plan)?.is_some())
    }

    /// The place of a plan (names or ids of its operators) in the set, or `None` where it is not in it.
    fn rank(&self, plan: Vec<Step>) -> PyResult<Option<BigUint>> {
        Ok(self.plan(plan)?.and_then(|plan| self.core.rank(&plan)))
    }

    /// Draws `k` plans uniformly; without `replace`, no plan twice. The same seed gives the same plans.
    ///
    /// Raises `ValueError` where there are too few plans.
    #[pyo3(signature = (k, seed, replace = true))]
    fn sample(&self, py: Python<'_>, k: usize, seed: u64, replace: bool) -> PyResult<Plans> {
        let draw = |limits: &Limits| match self.core.sample(k, seed, replace, limits) {
            Err(SampleError::Limit(error)) => Err(error),
            drawn => Ok(drawn),
        };
        match interrupt::run(py, &Limits::default(), draw)? {
            Ok(plans) => self.batch(py, plans),
            Err(error) => Err(PyValueError::new_err(error.to_string())),
        }
    }

    /// The first of the shortest plans, or `None` where there is no plan.
    fn shortest<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        let plan = self.core.shortest();
        plan.map(|plan| self.names.plan(py, plan.0.iter().map(|operator| operator.0))).transpose()
    }

    /// The steps of a shortest plan, or `None` where there is no plan.
    fn shortest_length(&self) -> Option<usize> {
        self.core.shortest_length()
    }

    /// The entropy, in nats, of a plan drawn uniformly.
    fn entropy(&self) -> f64 {
        self.core.entropy()
    }

    /// What may follow a prefix of operators: (operator id, number of plans that go on so); the id `None` is the end.
    fn next_operators(&self, prefix: Vec<Step>) -> PyResult<Vec<(Option<u32>, BigUint)>> {
        let next = self.plan(prefix)?.map(|prefix| self.core.next_operators(&prefix.0)).unwrap_or_default();
        Ok(next.into_iter().map(|(operator, plans)| (operator.map(|id| id.0), plans)).collect())
    }

    /// The plans from `start` to `stop` in IPC form, a block each, blocks separated by a blank line.
    #[pyo3(signature = (start = None, stop = None))]
    fn text(&self, py: Python<'_>, start: Option<BigUint>, stop: Option<BigUint>) -> PyResult<String> {
        let range = start.unwrap_or_default()..stop.unwrap_or_else(|| self.core.count());
        interrupt::run(py, &Limits::default(), |limits| self.core.text(range, limits))
    }

    fn __repr__(&self) -> String {
        let set = &self.core;
        format!("<PlanSet: {} {} plans of at most {} steps>", set.count(), set.semantics().name(), set.horizon())
    }
}

/// Plans one after another; holds a chunk of them at a time.
#[pyclass(module = "strips_lm._native")]
pub struct PlanIterator {
    set: PlanSet,
    next: BigUint,
    chunk: search::Plans,
    at: usize,
}

#[pymethods]
impl PlanIterator {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        if self.at == self.chunk.len() {
            let end = &self.next + CHUNK;
            self.chunk = self.set.flat(py, self.next.clone()..end.clone())?;
            (self.next, self.at) = (end, 0);
        }
        if self.chunk.is_empty() {
            return Ok(None);
        }
        self.at += 1;
        self.set.names.plan(py, self.chunk.operators_of(self.at - 1).iter().copied()).map(Some)
    }
}

/// Some plans, as two flat numpy arrays: plan `i` has the operators `operators[offsets[i]:offsets[i + 1]]`.
#[pyclass(frozen, sequence, module = "strips_lm._native")]
pub struct Plans {
    names: Arc<OperatorNames>,
    set: Arc<search::PlanSet>,
    operators: Py<PyArray1<u32>>,
    offsets: Py<PyArray1<i64>>,
}

impl Plans {
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<(PyReadonlyArray1<'py, u32>, PyReadonlyArray1<'py, i64>)> {
        Ok((self.operators.bind(py).try_readonly()?, self.offsets.bind(py).try_readonly()?))
    }

    fn plan<'py>(&self, py: Python<'py>, index: isize) -> PyResult<Bound<'py, PyTuple>> {
        let (operators, offsets) = self.arrays(py)?;
        let (operators, offsets) = (operators.as_slice()?, offsets.as_slice()?);
        let plan = if index < 0 { index + offsets.len().cast_signed() - 1 } else { index };
        let bounds = usize::try_from(plan).ok().and_then(|plan| offsets.get(plan..=plan + 1));
        let [start, end] = bounds.ok_or_else(|| PyIndexError::new_err("there are not as many plans"))? else {
            unreachable!("two bounds were asked for")
        };
        self.names.plan(py, operators[place(*start)..place(*end)].iter().copied())
    }

    /// The plans of a slice, copied.
    fn part(&self, py: Python<'_>, slice: &Bound<'_, PySlice>) -> PyResult<Self> {
        let (operators, offsets) = self.arrays(py)?;
        let (operators, offsets) = (operators.as_slice()?, offsets.as_slice()?);
        let wanted = slice.indices(offsets.len().cast_signed() - 1)?;
        let mut plans = search::Plans { operators: Vec::new(), offsets: vec![0] };
        let mut plan = wanted.start;
        for _ in 0..wanted.slicelength {
            let at = plan.cast_unsigned();
            plans.operators.extend(&operators[place(offsets[at])..place(offsets[at + 1])]);
            plans.offsets.push(plans.operators.len() as u64);
            plan += wanted.step;
        }
        batch(py, &self.names, &self.set, plans)
    }
}

#[pymethods]
impl Plans {
    /// Operator ids, plan after plan; read-only.
    #[getter]
    fn operators(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.operators.clone_ref(py)
    }

    /// Where each plan begins, and where the last one ends; read-only.
    #[getter]
    fn offsets(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.offsets.clone_ref(py)
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.arrays(py)?.1.as_slice()?.len() - 1)
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        match index.cast::<PySlice>() {
            Ok(slice) => Ok(self.part(py, slice)?.into_pyobject(py)?.into_any()),
            Err(_) => Ok(self.plan(py, index.extract()?)?.into_any()),
        }
    }

    /// The plans in IPC form, a block each, blocks separated by a blank line.
    fn text(&self, py: Python<'_>) -> PyResult<String> {
        let (operators, offsets) = self.arrays(py)?;
        let (operators, offsets) = (operators.as_slice()?, offsets.as_slice()?);
        let plans = offsets.windows(2).map(|ends| &operators[place(ends[0])..place(ends[1])]);
        interrupt::detached(py, || self.set.text_of(plans))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<Plans: {}>", self.__len__(py)?))
    }
}

/// Plans of a set as read-only arrays.
fn batch(
    py: Python<'_>,
    names: &Arc<OperatorNames>,
    set: &Arc<search::PlanSet>,
    plans: search::Plans,
) -> PyResult<Plans> {
    let offsets: Vec<i64> = plans.offsets.into_iter().map(u64::cast_signed).collect();
    let (operators, offsets) = (plans.operators.into_pyarray(py), offsets.into_pyarray(py));
    operators.try_readwrite()?.make_nonwriteable();
    offsets.try_readwrite()?.make_nonwriteable();
    let (operators, offsets) = (operators.unbind(), offsets.unbind());
    Ok(Plans { names: names.clone(), set: set.clone(), operators, offsets })
}

fn place(offset: i64) -> usize {
    usize::try_from(offset).expect("offsets are made from lengths and cannot be written")
}

/// What a slice of any length selects, clipped to the set as Python clips to a sequence.
struct Ranks {
    start: BigInt,
    stop: BigInt,
    step: BigInt,
}

impl Ranks {
    fn of(slice: &Bound<'_, PySlice>, count: &BigUint) -> PyResult<Self> {
        let step: BigInt = slice.getattr("step")?.extract::<Option<BigInt>>()?.unwrap_or_else(|| BigInt::from(1));
        if step.sign() == Sign::NoSign {
            return Err(PyValueError::new_err("slice step cannot be zero"));
        }
        let count_signed = BigInt::from(count.clone());
        let (first, end) = match step.sign() {
            Sign::Minus => (BigInt::from(-1), count_signed - 1),
            _ => (BigInt::ZERO, count_signed),
        };
        let bound = |name: &str, default: &BigInt| -> PyResult<BigInt> {
            let value: Option<BigInt> = slice.getattr(name)?.extract()?;
            Ok(value.map_or(default.clone(), |value| from_start(value, count).clamp(first.clone(), end.clone())))
        };
        let (from, to) = if step.sign() == Sign::Minus { (&end, &first) } else { (&first, &end) };
        Ok(Self { start: bound("start", from)?, stop: bound("stop", to)?, step })
    }

    /// The ranks one by one.
    fn list(&self, limits: &Limits) -> Result<Vec<BigUint>, LimitError> {
        let watch = limits.start();
        let up = self.step.sign() == Sign::Plus;
        let (mut ranks, mut rank) = (Vec::new(), self.start.clone());
        while if up { rank < self.stop } else { rank > self.stop } {
            if ranks.len() % 4096 == 0 {
                watch.check()?;
                watch.bytes(ranks.len() * size_of::<BigUint>())?;
            }
            ranks.push(natural(rank.clone()));
            rank += &self.step;
        }
        Ok(ranks)
    }
}

/// A rank that is known not to be negative.
fn natural(rank: BigInt) -> BigUint {
    rank.max(BigInt::ZERO).magnitude().clone()
}

/// An index that may count from the end.
fn from_start(index: BigInt, count: &BigUint) -> BigInt {
    if index < BigInt::ZERO { index + BigInt::from(count.clone()) } else { index }
}
