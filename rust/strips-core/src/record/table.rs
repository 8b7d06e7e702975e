//! Columns, as flat arrays that cross into Python without a copy for each value.

use super::shape::{Shape, Source};
use crate::pddl::print_problem;

/// A column of texts: all bytes, and where each text ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texts {
    /// Where each text begins, and where the last one ends.
    pub offsets: Vec<i32>,
    /// The texts, one after the other.
    pub bytes: Vec<u8>,
}

impl Default for Texts {
    fn default() -> Self {
        Self { offsets: vec![0], bytes: Vec::new() }
    }
}

impl Texts {
    /// Adds one text.
    ///
    /// # Panics
    /// When the column passes 2 GiB; batches are far smaller.
    pub fn push(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.offsets.push(i32::try_from(self.bytes.len()).expect("a batch stays below 2 GiB"));
    }

    /// The number of texts.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is no text.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The text with this number.
    pub fn get(&self, index: usize) -> &str {
        let place = |index: usize| usize::try_from(self.offsets[index]).expect("offsets are not negative");
        let bytes = &self.bytes[place(index)..place(index + 1)];
        std::str::from_utf8(bytes).expect("only whole texts are added")
    }

    fn reserve<'p>(&mut self, parts: impl Iterator<Item = &'p Self> + Clone) {
        self.offsets.reserve(parts.clone().map(Self::len).sum());
        self.bytes.reserve(parts.map(|part| part.bytes.len()).sum());
    }

    fn append(&mut self, other: &Self) {
        let base = i32::try_from(self.bytes.len()).expect("a batch stays below 2 GiB");
        self.bytes.extend_from_slice(&other.bytes);
        self.offsets.extend(other.offsets[1..].iter().map(|offset| base + offset));
    }
}

/// A column of lists of texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextLists {
    /// Where each list begins among the texts, and where the last one ends.
    pub offsets: Vec<i32>,
    /// The texts of all lists.
    pub texts: Texts,
}

impl Default for TextLists {
    fn default() -> Self {
        Self { offsets: vec![0], texts: Texts::default() }
    }
}

impl TextLists {
    /// Adds one list.
    pub fn push<S: AsRef<str>>(&mut self, list: &[S]) {
        for text in list {
            self.texts.push(text.as_ref());
        }
        self.offsets.push(count(self.texts.len()));
    }

    fn reserve<'p>(&mut self, parts: impl Iterator<Item = &'p Self> + Clone) {
        self.offsets.reserve(parts.clone().map(|part| part.offsets.len() - 1).sum());
        self.texts.reserve(parts.map(|part| &part.texts));
    }

    fn append(&mut self, other: &Self) {
        let base = count(self.texts.len());
        self.texts.append(&other.texts);
        self.offsets.extend(other.offsets[1..].iter().map(|offset| base + offset));
    }
}

macro_rules! columns {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty => $how:ident,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name { $($(#[$field_doc])* pub $field: $kind,)* }

        impl $name {
            /// Adds another batch's rows.
            pub fn append(&mut self, other: &Self) {
                $(append!($how, self.$field, other.$field);)*
            }

            /// The rows of all parts, in room that is made once.
            pub fn joined(parts: &[Self]) -> Self {
                let mut whole = Self::default();
                $(reserve!($how, whole.$field, parts.iter().map(|part| &part.$field));)*
                for part in parts {
                    whole.append(part);
                }
                whole
            }
        }
    };
}

macro_rules! append {
    (texts, $to:expr, $from:expr) => {
        $to.append(&$from)
    };
    (numbers, $to:expr, $from:expr) => {
        $to.extend_from_slice(&$from)
    };
}

macro_rules! reserve {
    (texts, $to:expr, $parts:expr) => {
        $to.reserve($parts)
    };
    (numbers, $to:expr, $parts:expr) => {
        $to.reserve($parts.map(Vec::len).sum())
    };
}

columns! {
    /// Records as columns; `docs/record-format.md` says what each holds.
    Batch {
        /// Position in the split.
        index: Vec<i64> => numbers,
        /// The prompt.
        prompt: Texts => texts,
        /// The right completion.
        completion: Texts => texts,
        /// A wrong completion.
        negative: Texts => texts,
        /// The plan in IPC form.
        plan: Texts => texts,
        /// How the negative was made.
        negative_kind: Texts => texts,
        /// What is wrong with it.
        negative_verdict: Texts => texts,
        /// The step that proves it.
        negative_step: Vec<i32> => numbers,
        /// The row of the problems table.
        problem_id: Vec<i32> => numbers,
        /// Object names.
        names: TextLists => texts,
        /// Action words.
        words: TextLists => texts,
        /// The template's name.
        template: Texts => texts,
        /// The prompt's style.
        style: Texts => texts,
        /// How the goal is said.
        goal_style: Texts => texts,
        /// Steps of the plan.
        steps: Vec<i32> => numbers,
        /// Steps of a shortest plan, or [`UNKNOWN`].
        optimal_steps: Vec<i32> => numbers,
        /// How many plans this one was drawn from.
        plan_count: Texts => texts,
        /// Seeds this record.
        seed: Vec<u64> => numbers,
    }
}

/// Bytes of a long text, about.
const TEXT: usize = 1024;

impl Batch {
    /// An empty batch with room for this many usual records.
    pub(super) fn with_room(records: usize) -> Self {
        let mut batch = Self::default();
        for column in [&mut batch.prompt, &mut batch.completion, &mut batch.negative] {
            column.bytes.reserve(records * TEXT);
        }
        batch
    }
}

columns! {
    /// The problems that records refer to.
    ProblemTable {
        /// The row.
        problem_id: Vec<i32> => numbers,
        /// The problem in PDDL.
        problem: Texts => texts,
        /// The domain's name.
        domain: Texts => texts,
        /// The template's name.
        template: Texts => texts,
        /// Objects, constants included.
        num_objects: Vec<i32> => numbers,
        /// Stands for initial state and goal up to names.
        canonical_hash: Texts => texts,
        /// Steps of a shortest plan, or [`UNKNOWN`].
        shortest: Vec<i32> => numbers,
        /// How the goal is said.
        goal_style: Texts => texts,
    }
}

impl ProblemTable {
    pub(super) fn push(&mut self, id: usize, shape: &Shape, template: &str) {
        let problem = shape.problem(&format!("{template}-{id}"));
        self.problem_id.push(count(id));
        self.problem.push(&print_problem(&problem, &shape.task.domain));
        self.domain.push(&shape.task.domain.name);
        self.template.push(template);
        self.num_objects.push(count(problem.objects.len()));
        self.canonical_hash.push(&format!("{:032x}", shape.hash));
        self.shortest.push(shape.shortest.map_or(UNKNOWN, count));
        self.goal_style.push(shape.goal_style().name());
    }
}

/// What a column of lengths holds where nothing is proven.
pub const UNKNOWN: i32 = -1;

/// A number of things as a column holds it.
pub(super) fn count(number: usize) -> i32 {
    i32::try_from(number).expect("a column counts below two thousand million")
}

/// What `template` says where a problem is of none.
pub(super) fn template_name(source: Source, names: &[String]) -> &str {
    match source {
        Source::Template(number) => &names[number],
        Source::Given => "given",
        Source::Random => "random",
        Source::Large => "large",
    }
}
