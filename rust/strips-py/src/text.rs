//! The text format and its canonical rewriting, in batches.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use strips_core::text::canonical::{self, Codec, EncodedIds, Layout, Rows};
use strips_core::text::{self, GoalStyle};

use crate::error::DataError;
use crate::interrupt;
use crate::pddl::Domain;

type PyAtom = (String, Vec<String>);
type PyStep = (PyAtom, Option<Vec<PyAtom>>);
type PyEncodedIds<'py> = (Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Vec<Legend>);

/// A completion as far as it makes sense.
#[pyclass(frozen, get_all, module = "strips_lm._native")]
pub struct Completion {
    /// For each step the action and the state after it, if there is one; atoms are (name, arguments).
    steps: Vec<PyStep>,
    /// Whether the end token was reached.
    finished: bool,
    /// Byte offset of what cannot be read, and what was expected there.
    malformed: Option<(usize, String)>,
}

impl From<text::Completion<'_>> for Completion {
    fn from(completion: text::Completion<'_>) -> Self {
        let step =
            |step: text::Step<'_>| (atom(&step.action), step.state.map(|state| state.iter().map(atom).collect()));
        Self {
            steps: completion.steps.into_iter().map(step).collect(),
            finished: completion.finished,
            malformed: completion.malformed.map(|malformed| (malformed.offset, malformed.expected.to_owned())),
        }
    }
}

fn atom(atom: &text::TextAtom<'_>) -> PyAtom {
    (atom.name.to_owned(), atom.args.iter().map(|&arg| arg.to_owned()).collect())
}

/// Reads completions; never fails, but says how far each makes sense.
#[pyfunction]
pub fn parse_completions(py: Python<'_>, texts: Vec<PyBackedStr>) -> PyResult<Vec<Completion>> {
    interrupt::detached(py, || text::parse_completions(&texts).into_iter().map(Completion::from).collect())
}

/// Parts each text into prompt and completion, without the space between them.
#[pyfunction]
pub fn split_texts(texts: Vec<PyBackedStr>) -> (Vec<String>, Vec<String>) {
    let parts = texts.iter().map(|whole| text::split_text(whole));
    parts.map(|(prompt, completion)| (prompt.to_owned(), completion.to_owned())).unzip()
}

/// What canonical words leave out of a text: names, words, and what the words cannot say.
#[pyclass(frozen, module = "strips_lm._native")]
#[derive(Clone)]
pub struct Legend {
    pub core: Arc<canonical::Legend>,
}

impl AsRef<canonical::Legend> for Legend {
    fn as_ref(&self) -> &canonical::Legend {
        &self.core
    }
}

#[pymethods]
impl Legend {
    /// The object of each slot.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.core.names.clone()
    }

    /// The word for each action of the domain.
    #[getter]
    fn words(&self) -> Vec<String> {
        self.core.words.clone()
    }

    /// The word for each predicate of the domain; empty where all go by their names.
    #[getter]
    fn predicates(&self) -> Vec<String> {
        self.core.predicates.clone()
    }

    /// The legend as JSON.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&*self.core).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// The legend that `to_json` wrote.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let core = serde_json::from_str(text).map_err(|error| DataError::new_err(error.to_string()))?;
        Ok(Self { core: Arc::new(core) })
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_json")?.unbind(), (slf.get().to_json()?,)))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.core == other.core
    }
}

/// Rewrites texts into few words of a small vocabulary, and back without losing a byte.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct CanonicalCodec {
    pub core: Arc<Codec>,
}

#[pymethods]
impl CanonicalCodec {
    /// The codec of a domain, with the words that a lexicon (TOML) gives for its actions and predicates; `layout` is
    /// `difference`, `progress` or `report`.
    #[new]
    #[pyo3(signature = (domain, lexicon = None, *, layout = "difference"))]
    fn new(domain: &Domain, lexicon: Option<&str>, layout: &str) -> PyResult<Self> {
        Self::made(Codec::with_lexicon(&domain.ast, lexicon.unwrap_or(""), layout_of(layout)?))
    }

    /// The codec of several domains, each with its lexicon, in the order that `domains` of `encode` counts; with `kinds` an
    /// object's type stands before each mention of it.
    #[staticmethod]
    #[pyo3(signature = (domains, *, layout = "difference", kinds = false))]
    fn of_domains(domains: Vec<(PyRef<'_, Domain>, Option<String>)>, layout: &str, kinds: bool) -> PyResult<Self> {
        let layout = layout_of(layout)?;
        let one = |(domain, lexicon): &(PyRef<'_, Domain>, Option<String>)| {
            let codec = Codec::with_lexicon(&domain.ast, lexicon.as_deref().unwrap_or(""), layout);
            codec.map(|codec| codec.signatures()[0].clone())
        };
        let signatures: Result<Vec<_>, _> = domains.iter().map(one).collect();
        let made = signatures.map(|signatures| Codec::from_signatures(signatures, layout));
        Self::made(made.map(|codec| if kinds { codec.saying_kinds() } else { codec }))
    }

    /// The codec that `to_json` wrote.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        Self::made(Codec::from_json(text))
    }

    /// Everything the codec knows, as JSON.
    fn to_json(&self) -> String {
        self.core.to_json()
    }

    /// How much the rewriting takes out: `difference`, `progress` or `report`.
    #[getter]
    fn layout(&self) -> &'static str {
        match self.core.layout() {
            Layout::Difference => "difference",
            Layout::Progress => "progress",
            Layout::Report => "report",
        }
    }

    /// Whether an object's type stands before each mention of it.
    #[getter]
    fn kinds(&self) -> bool {
        self.core.says_kinds()
    }

    /// All words in the order of their ids, the slots `o0`, … last.
    #[pyo3(signature = (max_slots = 0))]
    fn vocabulary(&self, max_slots: usize) -> Vec<String> {
        self.core.vocabulary().with_slots(max_slots)
    }

    /// The id of slot 0; slot `n` is `n` more.
    #[getter]
    fn first_slot(&self) -> u32 {
        self.core.vocabulary().first_slot()
    }

    /// The id of the word for a type, an action or a predicate of that name; `None` where there is none of it.
    fn word_of(&self, name: &str) -> Option<u32> {
        self.core.vocabulary().id_of_name(name)
    }

    /// Words, joined by single spaces, and a legend for each text.
    #[pyo3(signature = (texts, words = None, names = None, goal_styles = None, domains = None))]
    fn encode(
        &self,
        py: Python<'_>,
        texts: Vec<PyBackedStr>,
        words: Option<Vec<Vec<String>>>,
        names: Option<Vec<Vec<String>>>,
        goal_styles: Option<Vec<String>>,
        domains: Option<Vec<usize>>,
    ) -> PyResult<(Vec<String>, Vec<Legend>)> {
        let hints = self.hints(texts.len(), words, names, goal_styles, domains)?;
        let rows = interrupt::detached(py, || self.core.encode_batch(&texts, &hints.rows()))?;
        Ok(rows.into_iter().map(|(words, legend)| (words, Legend { core: Arc::new(legend) })).unzip())
    }

    /// As `encode`, with ids for words: (ids, where each row starts and the total, words of each prompt, legends).
    #[pyo3(signature = (texts, words = None, names = None, goal_styles = None, domains = None))]
    fn encode_ids<'py>(
        &self,
        py: Python<'py>,
        texts: Vec<PyBackedStr>,
        words: Option<Vec<Vec<String>>>,
        names: Option<Vec<Vec<String>>>,
        goal_styles: Option<Vec<String>>,
        domains: Option<Vec<usize>>,
    ) -> PyResult<PyEncodedIds<'py>> {
        let hints = self.hints(texts.len(), words, names, goal_styles, domains)?;
        let EncodedIds { ids, offsets, prompt_lengths, legends } =
            interrupt::detached(py, || self.core.encode_ids_batch(&texts, &hints.rows()))?;
        let ids: Vec<i32> = ids.into_iter().map(u32::cast_signed).collect();
        let legends = legends.into_iter().map(|legend| Legend { core: Arc::new(legend) }).collect();
        Ok((ids.into_pyarray(py), indices(py, offsets), indices(py, prompt_lengths), legends))
    }

    /// The texts of rows of words; never fails.
    fn decode(&self, py: Python<'_>, rows: Vec<PyBackedStr>, legends: Vec<PyRef<'_, Legend>>) -> PyResult<Vec<String>> {
        let legends = legends_of(&legends, rows.len())?;
        interrupt::detached(py, || self.core.decode_batch(&rows, &legends))
    }

    /// The texts of completions alone, from the ids of their prompts and of their own words; never fails.
    fn decode_completions(
        &self,
        py: Python<'_>,
        prompts: Vec<Vec<u32>>,
        completions: Vec<Vec<u32>>,
        legends: Vec<PyRef<'_, Legend>>,
    ) -> PyResult<Vec<String>> {
        let legends = legends_of(&legends, prompts.len())?;
        same_length("completions", completions.len(), prompts.len())?;
        interrupt::detached(py, || self.core.decode_completion_batch(&prompts, &completions, &legends))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_json")?.unbind(), (slf.get().to_json(),)))
    }

    fn __repr__(&self) -> String {
        let names: Vec<_> = self.core.signatures().iter().map(|signature| &signature.name[..]).collect();
        format!("<CanonicalCodec {}: {} words>", names.join(", "), self.core.vocabulary().words().len())
    }
}

impl CanonicalCodec {
    fn made(codec: Result<Codec, canonical::CodecError>) -> PyResult<Self> {
        codec.map(|core| Self { core: Arc::new(core) }).map_err(|error| DataError::new_err(error.to_string()))
    }

    fn hints(
        &self,
        rows: usize,
        words: Option<Vec<Vec<String>>>,
        names: Option<Vec<Vec<String>>>,
        goal_styles: Option<Vec<String>>,
        domains: Option<Vec<usize>>,
    ) -> PyResult<OwnedRows> {
        let lengths = [
            ("words", words.as_ref().map(Vec::len)),
            ("names", names.as_ref().map(Vec::len)),
            ("goal_styles", goal_styles.as_ref().map(Vec::len)),
            ("domains", domains.as_ref().map(Vec::len)),
        ];
        lengths.iter().try_for_each(|&(what, length)| same_length(what, length.unwrap_or(rows), rows))?;
        let known = self.core.signatures().len();
        if domains.iter().flatten().any(|&domain| domain >= known) {
            return Err(PyValueError::new_err(format!("the codec knows {known} domains")));
        }
        let styles = goal_styles.map(|styles| styles.iter().map(|style| goal_style(style)).collect()).transpose()?;
        Ok(OwnedRows { domains, names, words, goal_styles: styles })
    }
}

/// [`Rows`] that own what they tell.
struct OwnedRows {
    domains: Option<Vec<usize>>,
    names: Option<Vec<Vec<String>>>,
    words: Option<Vec<Vec<String>>>,
    goal_styles: Option<Vec<GoalStyle>>,
}

impl OwnedRows {
    fn rows(&self) -> Rows<'_> {
        Rows {
            domains: self.domains.as_deref(),
            names: self.names.as_deref(),
            words: self.words.as_deref(),
            goal_styles: self.goal_styles.as_deref(),
        }
    }
}

fn goal_style(name: &str) -> PyResult<GoalStyle> {
    GoalStyle::from_name(name)
        .ok_or_else(|| PyValueError::new_err(format!("goal style `{name}`: expected `state` or `problem`")))
}

fn layout_of(name: &str) -> PyResult<Layout> {
    match name {
        "difference" => Ok(Layout::Difference),
        "progress" => Ok(Layout::Progress),
        "report" => Ok(Layout::Report),
        _ => Err(PyValueError::new_err(format!("layout `{name}`: expected `difference`, `progress` or `report`"))),
    }
}

fn legends_of(legends: &[PyRef<'_, Legend>], rows: usize) -> PyResult<Vec<Legend>> {
    same_length("legends", legends.len(), rows)?;
    Ok(legends.iter().map(|legend| Legend::clone(legend)).collect())
}

fn same_length(what: &str, length: usize, rows: usize) -> PyResult<()> {
    if length == rows { Ok(()) } else { Err(PyValueError::new_err(format!("{length} {what} for {rows} rows"))) }
}

fn indices(py: Python<'_>, values: Vec<usize>) -> Bound<'_, PyArray1<i64>> {
    values.into_iter().map(|value| value.cast_signed() as i64).collect::<Vec<_>>().into_pyarray(py)
}
