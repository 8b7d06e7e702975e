//! What may be known about a text beside its bytes.

use super::super::GoalStyle;

/// Side information about one text. All of it is optional, and none of it can make the rewriting lose bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints<'a> {
    /// The text's domain: position in [`super::Codec::signatures`].
    pub domain: usize,
    /// Object names in order of declaration, from which the order of atoms in states follows.
    pub names: Option<&'a [String]>,
    /// The word for each action, then, where they are more than that, for each predicate.
    pub words: Option<&'a [String]>,
    /// Whether the goal is a whole state. Without it that is guessed, as the text does not say: whole is a goal without
    /// negative literals, in the order of predicates, with all static atoms and two fifths of the predicates of the
    /// initial state, and half as long as that; three quarters as long if they have no atom in common.
    pub goal_style: Option<GoalStyle>,
}

/// [`Hints`] for each of many texts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rows<'a> {
    /// By row: the domain; all are the first one's where missing.
    pub domains: Option<&'a [usize]>,
    /// By row: object names.
    pub names: Option<&'a [Vec<String>]>,
    /// By row: words for actions and, after them, predicates.
    pub words: Option<&'a [Vec<String>]>,
    /// By row: whether the goal is a whole state.
    pub goal_styles: Option<&'a [GoalStyle]>,
}

impl<'a> Rows<'a> {
    /// The hints for one row.
    pub fn row(&self, row: usize) -> Hints<'a> {
        Hints {
            domain: self.domains.map_or(0, |domains| domains[row]),
            names: self.names.map(|names| &names[row][..]),
            words: self.words.map(|words| &words[row][..]),
            goal_style: self.goal_styles.map(|styles| styles[row]),
        }
    }
}
