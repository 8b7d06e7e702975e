//! Parting a text at its markers, so that joining the parts gives its bytes.

use super::super::{ACTION, END, GOAL, INIT, OBJECTS, START, STATE, VOCAB};

/// A marker of the text format. Its number is its id in the vocabulary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Marker {
    End,
    Start,
    Goal,
    Init,
    Action,
    State,
    Objects,
    Vocab,
}

/// The markers in the order of their ids: the end token, which pads as well, then the added tokens.
pub(crate) const MARKERS: [(Marker, &str); 8] = [
    (Marker::End, END),
    (Marker::Start, START),
    (Marker::Goal, GOAL),
    (Marker::Init, INIT),
    (Marker::Action, ACTION),
    (Marker::State, STATE),
    (Marker::Objects, OBJECTS),
    (Marker::Vocab, VOCAB),
];

impl Marker {
    pub(crate) fn text(self) -> &'static str {
        MARKERS[self as usize].1
    }

    pub(crate) fn of_id(id: u32) -> Option<Self> {
        MARKERS.get(id as usize).map(|marker| marker.0)
    }

    /// Whether a completion may begin with it.
    pub(crate) fn begins_completion(self) -> bool {
        matches!(self, Marker::Action | Marker::End)
    }
}

/// A marker and what follows it, up to the space before the next one: nothing, or something that begins with a space.
pub(crate) type Segment<'a> = (Marker, &'a str);

/// Fills `segments` and gives back what stands before the first marker, without the space between them.
///
/// A marker counts where a space (or nothing) is before it, and a space (or nothing) after it.
pub(crate) fn split<'a>(text: &'a str, segments: &mut Vec<Segment<'a>>) -> &'a str {
    segments.clear();
    let mut head = text;
    let mut open: Option<(Marker, usize)> = None;
    let mut from = 0;
    while let Some(found) = text[from..].find('<').map(|offset| from + offset) {
        from = found + 1;
        let Some(marker) = marker_at(text, found) else { continue };
        let before = &text[..found.saturating_sub(1)];
        match open {
            Some((previous, start)) => segments.push((previous, &before[start..])),
            None => head = before,
        }
        from = found + marker.text().len();
        open = Some((marker, from));
    }
    if let Some((last, start)) = open {
        segments.push((last, &text[start..]));
    }
    head
}

fn marker_at(text: &str, position: usize) -> Option<Marker> {
    let rest = &text[position..];
    let (marker, name) = MARKERS.into_iter().find(|(_, name)| rest.starts_with(name))?;
    let free_before = position == 0 || text.as_bytes()[position - 1] == b' ';
    let free_after = matches!(rest.as_bytes().get(name.len()), None | Some(b' '));
    (free_before && free_after).then_some(marker)
}
