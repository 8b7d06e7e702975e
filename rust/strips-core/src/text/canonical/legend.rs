//! What canonical words leave out of a text.

use serde::{Deserialize, Serialize};

use super::vocabulary::Word;
use super::wanted::Wanted;

/// Names and words of one text, and the text of what its canonical words cannot say.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Legend {
    /// The text's domain: position in the codec's signatures.
    pub domain: usize,
    /// The object of each slot.
    pub names: Vec<String>,
    /// For each slot its object's place in the order of declaration; empty where that is the order of the slots.
    pub ranks: Vec<u16>,
    /// The word for each action.
    pub words: Vec<String>,
    /// The word for each predicate; empty where all go by their names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub predicates: Vec<String>,
    /// The word for the type of each slot's object that is said before it, 0 where none is; later slots have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<Word>,
    /// What the goal wants, where changes of state say whether they lead toward it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted: Option<Wanted>,
    /// What follows the prompt's markers where canonical words do not say it to the byte.
    #[serde(default, skip_serializing_if = "Exceptions::is_empty")]
    pub exceptions: Exceptions,
}

/// Parts of the text kept as they are, each with the space before it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exceptions {
    /// The whole prompt, if it is not made as prompts are.
    pub prompt: Option<String>,
    /// After `<OBJECTS>`.
    pub objects: Option<String>,
    /// After `<VOCAB>`.
    pub vocab: Option<String>,
    /// After `<GOAL>`.
    pub goal: Option<String>,
    /// After `<INIT>`.
    pub init: Option<String>,
    /// After the n-th marker of the completion.
    pub completion: Vec<(u32, String)>,
}

impl Exceptions {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// What follows the `number`-th marker of the completion, if that is an exception.
    pub(super) fn after(&self, number: u32) -> Option<&str> {
        let found = self.completion.binary_search_by_key(&number, |exception| exception.0).ok()?;
        Some(&self.completion[found].1)
    }
}

impl AsRef<Legend> for Legend {
    fn as_ref(&self) -> &Legend {
        self
    }
}
