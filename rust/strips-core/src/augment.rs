//! From one problem to many texts: problems with holes, names for objects, words for actions, and when two problems
//! are the same but for names.
//!
//! [`Template`] reads and fills a problem with holes; [`Lexicon`] holds names and words, trained and held out;
//! [`Naming`] draws them for one record; [`Structure`] has a canonical form. Knows nothing of plans or text layout.

mod canonical_form;
mod error;
mod lexicon;
mod made_up;
mod naming;
mod template;

pub use canonical_form::{Structure, canonical_hash};
pub use error::{LexiconError, LexiconErrorKind};
pub use lexicon::{Hold, Lexicon};
pub use made_up::made_up_word;
pub use naming::{Names, Naming};
pub use template::{Template, read_template};
