//! Of any text and any words at all: nothing is lost, nothing fails.

use proptest::collection::vec;
use proptest::prelude::*;

use super::*;

/// Names, some of them nasty.
fn name() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => "[a-e]",
        1 => Just("o0".to_owned()),
        1 => Just("#3".to_owned()),
        1 => Just("pick".to_owned()),
        1 => "[a-zé/'+!-]{1,4}",
    ]
}

fn atom() -> impl Strategy<Value = String> {
    let predicate = prop_oneof![
        8 => proptest::sample::select(vec![("inhand", 1), ("inworkspace", 1), ("on", 2), ("in", 2), ("opened", 1)]),
        2 => Just(("atop", 2)),
        1 => Just(("upon", 2)),
        1 => Just(("near", 2)),
        1 => Just(("on", 3)),
        1 => Just(("inhand", 0)),
    ];
    predicate.prop_flat_map(|(predicate, arity)| {
        vec(name(), arity).prop_map(move |args| format!("{predicate}({})", args.join(", ")))
    })
}

fn atoms() -> impl Strategy<Value = String> {
    vec(atom(), 0..6).prop_map(|atoms| atoms.join(", "))
}

/// A state in canonical order, or one that is not.
fn state() -> impl Strategy<Value = String> {
    let known = proptest::sample::subsequence(
        vec!["inhand(a)", "inworkspace(a)", "inworkspace(b)", "on(a, b)", "on(b, a)", "opened(a)", "opened(b)"],
        0..7,
    );
    prop_oneof![3 => known.prop_map(|atoms| atoms.join(", ")), 1 => atoms()]
}

fn goal() -> impl Strategy<Value = String> {
    let literal =
        (any::<bool>(), atom()).prop_map(|(positive, atom)| if positive { atom } else { format!("not {atom}") });
    prop_oneof![state(), vec(literal, 0..5).prop_map(|literals| literals.join(", "))]
}

fn segment(marker: &'static str, content: impl Strategy<Value = String>) -> impl Strategy<Value = String> {
    content.prop_map(move |content| if content.is_empty() { marker.to_owned() } else { format!("{marker} {content}") })
}

fn pairs(first: impl Strategy<Value = String>, second: &'static str) -> impl Strategy<Value = String> {
    vec((first, second.prop_map(|word| word)), 0..5)
        .prop_map(|pairs| pairs.iter().map(|(a, b)| format!("{a} {b}")).collect::<Vec<_>>().join(", "))
}

fn prompt() -> impl Strategy<Value = String> {
    let objects = proptest::option::of(segment("<OBJECTS>", pairs(name(), "vessel|tool|tool/movable|gizmo")));
    let vocab = proptest::option::of(segment(
        "<VOCAB>",
        pairs(prop_oneof![name(), "pick|on|in|opened"], "lift|put|x[a-c]|on|in|atop"),
    ));
    (objects, vocab, segment("<GOAL>", goal()), segment("<INIT>", state())).prop_map(|(objects, vocab, goal, init)| {
        let parts = [Some("<|startoftext|>".to_owned()), objects, vocab, Some(goal), Some(init)];
        parts.into_iter().flatten().collect::<Vec<_>>().join(" ")
    })
}

fn completion() -> impl Strategy<Value = String> {
    let word = proptest::sample::select(vec!["pick", "lift", "put", "place", "open", "juggle", "xa"]);
    let action = (word, vec(name(), 0..4)).prop_map(|(word, args)| format!("{word}({})", args.join(", ")));
    let step = (segment("<ACTION>", action), segment("<STATE>", state())).prop_map(|(a, s)| format!("{a} {s}"));
    (vec(step, 0..5), any::<bool>()).prop_map(|(mut steps, end)| {
        steps.extend(end.then(|| "<|endoftext|>".to_owned()));
        steps.join(" ")
    })
}

/// Any text of the format, sometimes cut off, sometimes with a stray piece in it.
fn text() -> impl Strategy<Value = String> {
    let stray =
        proptest::sample::select(vec![" ", "  ", "<STATE>", " <ACTION> ", "(", ",", "\n", "<|endoftext|>", " <GOAL> "]);
    let damage = proptest::option::weighted(0.3, (any::<prop::sample::Index>(), proptest::option::of(stray)));
    (prompt(), completion(), damage).prop_map(|(prompt, completion, damage)| {
        let text = if completion.is_empty() { prompt } else { format!("{prompt} {completion}") };
        let Some((place, stray)) = damage else { return text };
        let cut = (0..=text.len()).filter(|&i| text.is_char_boundary(i)).collect::<Vec<_>>();
        let (before, after) = text.split_at(cut[place.index(cut.len())]);
        stray.map_or_else(|| before.to_owned(), |stray| format!("{before}{stray}{after}"))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn decoding_what_was_encoded_gives_the_text_back_to_the_byte(text in text(), names in vec(name(), 0..4), told in any::<bool>()) {
        for codec in codecs() {
            let style = told.then_some(GoalStyle::State);
            for hints in [hints(), Hints { names: Some(&names), words: Some(&names), goal_style: style, domain: 0 }] {
                let (words, legend) = codec.encode(&text, &hints);
                prop_assert_eq!(codec.decode(&words, &legend), text.as_str(), "{} {:?}", words, legend);
                prop_assert!(!words.contains("  ") && words.split(' ').all(|word| codec.vocabulary().id(word).is_some()));
                let (prompt, rest) = words.split_at(words.len() - split_text(&words).1.len());
                let read = |words| codec.vocabulary().ids(words, &mut vec![]);
                let completion = codec.decode_completion(&read(prompt), &read(rest), &legend);
                prop_assert!(text.ends_with(&completion));
            }
        }
    }

    #[test]
    fn any_string_at_all_is_given_back(text in "(<[A-Z]{4,6}>| |on\\(a, b\\)|<\\|startoftext\\|>|[a-c<>(), é])*") {
        let codec = codec(Layout::Difference);
        let (words, legend) = codec.encode(&text, &hints());
        prop_assert_eq!(codec.decode(&words, &legend), text);
    }

    #[test]
    fn any_words_at_all_are_decoded(words in vec(0u32..80, 0..40), prompt in prompt()) {
        for codec in codecs() {
            let mut ids = Vec::new();
            let legend = codec.encode_into(&prompt, &hints(), &mut ids);
            let completion = codec.decode_completion(&ids, &words, &legend);
            let _ = parse_completion(&completion);
            let _ = codec.decode(&codec.vocabulary().join(&words), &legend);
        }
    }
}
