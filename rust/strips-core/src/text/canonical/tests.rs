//! The rewriting loses no byte, of whatever text; and what it writes is what the documentation says.

mod properties;

use super::*;
use crate::text::tests::{FIGURE_4, manipulation};
use crate::text::{GoalStyle, parse_completion, split_text};

fn codec(layout: Layout) -> Codec {
    let actions = vec![vec!["lift".into()], vec!["put".into()]];
    let predicates = vec![vec![], vec![], vec!["atop".into(), "upon".into()]];
    let synonyms = Synonyms { actions, predicates };
    Codec::new(&[(&manipulation(), synonyms)], layout)
}

/// Every way of writing.
fn codecs() -> [Codec; 6] {
    let [a, b, c] = [Layout::Difference, Layout::Progress, Layout::Report].map(codec);
    [a.clone().saying_kinds(), b.clone().saying_kinds(), c.clone().saying_kinds(), a, b, c]
}

fn hints() -> Hints<'static> {
    Hints::default()
}

#[test]
fn the_figure_in_canonical_words() {
    let codec = codec(Layout::Difference);
    let (words, legend) = codec.encode(FIGURE_4, &hints());
    assert_eq!(
        words,
        "<|startoftext|> <INIT> inworkspace o0 inworkspace o1 inworkspace o2 on o1 o3 on o2 o3 \
         <GOAL> goal+on o1 o2 goal+on o2 o0 goal+opened o2 goal-on o1 o3 goal-on o2 o3 \
         <ACTION> pick o2 <STATE> +inhand o2 -on o2 o3 <ACTION> place o2 o0 <STATE> +on o2 o0 -inhand o2 \
         <ACTION> open o2 <STATE> +opened o2 <ACTION> pick o1 <STATE> +inhand o1 -on o1 o3 \
         <ACTION> place o1 o2 <STATE> +on o1 o2 -inhand o1 <|endoftext|>"
    );
    assert_eq!(legend.names, ["table", "teabag", "cup", "shelf"]);
    assert_eq!(legend.words, ["lift", "put", "push", "open", "close"]);
    assert!(legend.ranks.is_empty() && legend.exceptions.is_empty());
    assert_eq!(codec.decode(&words, &legend), FIGURE_4);
}

#[test]
fn changes_say_what_they_are_to_a_whole_state() {
    let codec = codec(Layout::Progress);
    let (words, legend) = codec.encode(FIGURE_4, &hints());
    let completion = &words[words.find("<ACTION>").unwrap()..];
    assert_eq!(
        completion,
        "<ACTION> pick o2 <STATE> away+inhand o2 toward-on o2 o3 <ACTION> place o2 o0 <STATE> toward+on o2 o0 toward-inhand o2 \
         <ACTION> open o2 <STATE> toward+opened o2 <ACTION> pick o1 <STATE> away+inhand o1 toward-on o1 o3 \
         <ACTION> place o1 o2 <STATE> toward+on o1 o2 toward-inhand o1 <|endoftext|>"
    );
    assert_eq!(codec.decode(&words, &legend), FIGURE_4);
    // A model's own words may say it wrong: the state is the same.
    let wrong = words.replace("away+", "toward+").replace("toward-", "-");
    assert_eq!(codec.decode(&wrong, &legend), FIGURE_4);
}

#[test]
fn changes_say_what_they_are_to_literals() {
    let codec = codec(Layout::Progress);
    let prompt = "<|startoftext|> <GOAL> on(a, b), not opened(c) <INIT> on(a, b), inworkspace(a)";
    let rest = "<ACTION> pick(a) <STATE> inhand(a), inworkspace(a) <ACTION> open(c) <STATE> inhand(a), inworkspace(a), opened(c) \
        <ACTION> place(a, b) <STATE> inworkspace(a), on(a, b), opened(c) <ACTION> close(c) <STATE> inworkspace(a), on(a, b) \
        <|endoftext|>";
    let text = format!("{prompt} {rest}");
    let (words, legend) = codec.encode(&text, &hints());
    assert_eq!(
        &words[words.find("<GOAL>").unwrap()..],
        "<GOAL> <partial> goal=on o0 o1 goal!opened o2 <ACTION> pick o0 <STATE> +inhand o0 away-on o0 o1 \
         <ACTION> open o2 <STATE> away+opened o2 <ACTION> place o0 o1 <STATE> toward+on o0 o1 -inhand o0 \
         <ACTION> close o2 <STATE> toward-opened o2 <|endoftext|>"
    );
    assert_eq!(codec.decode(&words, &legend), text);
    let saved: Legend = serde_json::from_str(&serde_json::to_string(&legend).unwrap()).unwrap();
    assert_eq!(saved, legend);
}

#[test]
fn the_figure_in_the_layout_of_the_report() {
    let codec = codec(Layout::Report);
    let (words, legend) = codec.encode(FIGURE_4, &hints());
    assert!(words.starts_with("<|startoftext|> <GOAL> inworkspace o0 inworkspace o1 inworkspace o2 on o1 o2 on o2 o0"));
    assert!(words.contains("<ACTION> pick o2 <STATE> inhand o2 inworkspace o0 inworkspace o1 inworkspace o2 on o1 o3"));
    assert_eq!(codec.decode(&words, &legend), FIGURE_4);
}

const TYPED: &str = "<|startoftext|> <OBJECTS> table fixture, zorg vessel/tool, b container <VOCAB> pick lift, place hoist, \
    push push, open open, close close <GOAL> on(zorg, table), not opened(b), not opened(zorg), inworkspace(table) \
    <INIT> inworkspace(table), on(zorg, b), opened(b)";

#[test]
fn a_partial_goal_says_what_holds_already() {
    let codec = codec(Layout::Difference);
    let (words, legend) = codec.encode(TYPED, &hints());
    assert_eq!(
        words,
        "<|startoftext|> <OBJECTS> o0 fixture o1 vessel tool o2 container \
         <INIT> inworkspace o0 on o1 o2 opened o2 \
         <GOAL> <partial> goal+on o1 o0 goal-opened o2 goal!opened o1 goal=inworkspace o0"
    );
    assert_eq!(legend.words, ["lift", "hoist", "push", "open", "close"]);
    assert_eq!(codec.decode(&words, &legend), TYPED);
}

#[test]
fn the_words_of_a_prompt_do_not_depend_on_what_follows() {
    for codec in codecs() {
        let text = format!("{TYPED} <ACTION> hoist(new, zorg) <STATE> on(b, new), on(b, b), on(b, a) <|endoftext|>");
        let (prompt, all) = (codec.encode(TYPED, &hints()).0, codec.encode(&text, &hints()).0);
        let kind = if codec.says_kinds() { "vessel " } else { "" };
        assert!(all.starts_with(&format!("{prompt} <ACTION> place o3 {kind}o1 <STATE>")), "{all}");
        let (prompt, all) = (codec.encode(split_text(FIGURE_4).0, &hints()).0, codec.encode(FIGURE_4, &hints()).0);
        assert!(all.starts_with(&prompt));
    }
}

#[test]
fn a_models_words_become_text_with_the_prompts_names() {
    let codec = codec(Layout::Difference);
    let (prompt, legend) = codec.encode(TYPED, &hints());
    let text = codec.decode(&format!("{prompt} <ACTION> pick o1 <STATE> +inhand o1 -on o1 o2 <|endoftext|>"), &legend);
    let completion = "<ACTION> lift(zorg) <STATE> inhand(zorg), inworkspace(table), opened(b) <|endoftext|>";
    assert_eq!(text, format!("{TYPED} {completion}"));
}

#[test]
fn predicates_are_their_names_whatever_the_words_for_them() {
    let (codec, own) = (codec(Layout::Difference), codec(Layout::Report));
    let said = |text: &str| {
        let text = text.replace("<GOAL>", "<VOCAB> pick lift, place put, inhand zorg, on in, in on <GOAL>");
        text.replace("on(", "in(").replace("inhand(", "zorg(")
    };
    for codec in [codec, own] {
        let (words, legend) = codec.encode(&said(FIGURE_4), &hints());
        assert_eq!(words, codec.encode(FIGURE_4, &hints()).0);
        assert_eq!(legend.predicates, ["zorg", "inworkspace", "in", "on", "opened"]);
        assert_eq!(codec.decode(&words, &legend), said(FIGURE_4));
        let (words, legend) = codec.encode(&FIGURE_4.replace("on(", "atop("), &hints());
        assert_eq!(words, codec.encode(FIGURE_4, &hints()).0, "the lexicon's words need no legend");
        assert_eq!(legend.predicates[2], "atop");
        assert!(codec.encode(FIGURE_4, &hints()).1.predicates.is_empty());
    }
}

#[test]
fn a_predicate_has_one_word_in_a_text() {
    let codec = codec(Layout::Difference);
    let text = "<|startoftext|> <GOAL> atop(a, b) <INIT> atop(a, c) <ACTION> pick(a) <STATE> on(a, b) <|endoftext|>";
    let (words, legend) = codec.encode(text, &hints());
    assert!(words.ends_with("<ACTION> pick o0 <STATE> <raw> <|endoftext|>"), "{words}");
    assert_eq!(codec.decode(&words, &legend), text);
}

#[test]
fn a_legend_tells_an_action_from_a_predicate_of_the_same_name() {
    let text = "(define (domain d) (:predicates (open ?x)) (:action open :parameters (?x) :effect (open ?x)))";
    let domain = crate::pddl::parse_domain(&crate::pddl::Source::new("d", text)).unwrap();
    let codec = Codec::new(&[(&domain, Synonyms::default())], Layout::Difference);
    let text =
        "<|startoftext|> <VOCAB> open uncap, open ajar <GOAL> ajar(box) <INIT> <ACTION> uncap(box) <STATE> ajar(box)";
    let (words, legend) = codec.encode(text, &hints());
    assert_eq!(words, "<|startoftext|> <INIT> <GOAL> goal+open o0 <ACTION> open o0 <STATE> +open o0");
    assert_eq!((&legend.words[..], &legend.predicates[..]), (&["uncap".to_owned()][..], &["ajar".to_owned()][..]));
    assert_eq!(codec.decode(&words, &legend), text);
}

#[test]
fn words_that_make_no_sense_are_told_at_their_place() {
    let codec = codec(Layout::Difference);
    let (prompt, legend) = codec.encode(TYPED, &hints());
    let prompt = codec.vocabulary().ids(&prompt, &mut vec![]);
    let cases = [
        ("<ACTION> pick o1 <STATE> +inhand o1 -on o1", 1, "<STATE> +inhand"),
        ("<ACTION> pick o1 <STATE> +inhand o1 o2 <|endoftext|>", 1, "<STATE> +inhand"),
        ("<ACTION> o1 <STATE> <|endoftext|>", 0, "<ACTION> o1"),
        ("<ACTION> <STATE> <|endoftext|>", 0, "<ACTION>"),
        ("pick o1 <ACTION>", 0, ""),
        ("<ACTION> pick o1 <STATE> <raw> <|endoftext|>", 1, "<STATE> "),
        ("<ACTION> pick o1 <STATE> goal+on o1 o0 <|endoftext|>", 1, "<STATE> goal+on"),
    ];
    for (words, steps, until) in cases {
        let text = codec.decode_completion(&prompt, &codec.vocabulary().ids(words, &mut vec![]), &legend);
        let completion = parse_completion(&text);
        let malformed = completion.malformed.unwrap_or_else(|| panic!("{text}"));
        assert_eq!((completion.steps.len(), completion.finished), (steps, false), "{text}");
        assert!(text[..malformed.offset].trim_end().ends_with(until.trim_end()), "{text}: {malformed}");
    }
    let unknown = codec.decode_completion(&prompt, &codec.vocabulary().ids("<ACTION> pick o9", &mut vec![]), &legend);
    assert_eq!(unknown, "<ACTION> lift(#9)");
}

#[test]
fn names_tell_the_order_of_atoms_where_the_prompt_does_not() {
    let codec = codec(Layout::Difference);
    let prompt = "<|startoftext|> <GOAL> inworkspace(b), inworkspace(a) <INIT> on(a, b)";
    let names = vec!["b".to_owned(), "a".to_owned()];
    let hints = Hints { names: Some(&names), goal_style: Some(GoalStyle::State), ..hints() };
    let (words, legend) = codec.encode(prompt, &hints);
    assert_eq!(legend.ranks, [1, 0]);
    assert!(legend.exceptions.is_empty());
    let text = codec.decode(&format!("{words} <ACTION> open o0 <STATE> +opened o0 +opened o1 -on o0 o1"), &legend);
    assert_eq!(text, format!("{prompt} <ACTION> open(a) <STATE> opened(b), opened(a)"));
}

#[test]
fn sorted_states_tell_the_order_of_objects() {
    let codec = codec(Layout::Difference);
    let text = "<|startoftext|> <GOAL> inhand(c), on(a, c) <INIT> on(a, c), opened(b) <ACTION> open(a) \
        <STATE> inworkspace(c), inworkspace(b), inworkspace(a) <|endoftext|>";
    let (words, legend) = codec.encode(text, &hints());
    assert!(legend.exceptions.is_empty() && !words.contains("<whole>"), "{words}");
    assert_eq!(codec.decode(&words, &legend), text);
}

#[test]
fn a_type_is_said_before_each_mention_of_its_object() {
    let codec = codec(Layout::Difference).saying_kinds();
    let (prompt, legend) = codec.encode(TYPED, &hints());
    assert_eq!(
        prompt,
        "<|startoftext|> <OBJECTS> o0 fixture o1 vessel tool o2 container \
         <INIT> inworkspace fixture o0 on vessel o1 container o2 opened container o2 \
         <GOAL> <partial> goal+on vessel o1 fixture o0 goal-opened container o2 goal!opened vessel o1 \
         goal=inworkspace fixture o0"
    );
    assert_eq!(codec.decode(&prompt, &legend), TYPED);
    let said = |words: &str| {
        let ids = |words| codec.vocabulary().ids(words, &mut vec![]);
        codec.decode_completion(&ids(&prompt), &ids(words), &legend)
    };
    let state = "<STATE> inhand(zorg), inworkspace(table), opened(b)";
    for words in [
        "pick vessel o1 <STATE> +inhand vessel o1 -on vessel o1 container o2",
        "pick o1 <STATE> +inhand tool o1 -on o1 o2",
    ] {
        assert_eq!(said(&format!("<ACTION> {words}")), format!("<ACTION> lift(zorg) {state}"), "names say it all");
    }
    assert_eq!(said("<ACTION> pick vessel tool o1"), "<ACTION> pick vessel tool o1", "no more than one type");
    assert_eq!(said("<ACTION> pick vessel"), "<ACTION> pick vessel");
}

#[test]
fn a_saved_codec_writes_the_same_words() {
    for codec in codecs() {
        assert_eq!(Codec::from_json(&codec.to_json()).unwrap().encode(TYPED, &hints()), codec.encode(TYPED, &hints()));
    }
    let codec = codec(Layout::Difference);
    let again = Codec::from_json(&codec.to_json()).unwrap();
    assert_eq!(again.vocabulary().words(), codec.vocabulary().words());
    assert_eq!(again.encode(FIGURE_4, &hints()), codec.encode(FIGURE_4, &hints()));
    assert!(Codec::from_json("{}").is_err());
    let (_, legend) = codec.encode(TYPED, &hints());
    assert_eq!(serde_json::from_str::<Legend>(&serde_json::to_string(&legend).unwrap()).unwrap(), legend);
}

#[test]
fn several_domains_share_one_vocabulary() {
    let mut other = manipulation();
    other.name = "other".into();
    other.predicates.swap(0, 2);
    other.predicates[1].name = "o1".into();
    let domains = [(&manipulation(), Synonyms::default()), (&other, Synonyms::default())];
    let codec = Codec::new(&domains, Layout::Difference);
    let text =
        "<|startoftext|> <GOAL> o1(o1) <INIT> on(x, o1), inhand(x) <ACTION> pick(x) <STATE> o1(o1) <|endoftext|>";
    let (words, legend) = codec.encode(text, &Hints { domain: 1, ..hints() });
    assert!(words.ends_with("<ACTION> pick o0 <STATE> +o1' o1 -on o0 o1 -inhand o0 <|endoftext|>"), "{words}");
    assert_eq!(codec.decode(&words, &legend), text);
    let domains = [0, 1];
    let rows = codec.encode_batch(&[FIGURE_4, text], &Rows { domains: Some(&domains), ..Rows::default() });
    assert_eq!(rows[1], (words, legend));
}

#[test]
fn names_that_look_like_other_words_keep_apart() {
    for names in [
        ["on", "goal-on", "goal-goal-on", "away-on", "toward-goal-on"],
        ["on", "goal-on", "'goal-on", "''goal-on", "goal-'goal-on"],
        ["o1", "o1'", "o1''", "'o1", "+o1"],
    ] {
        names_keep_apart(names, true);
    }
    // A text cannot be split where these stand, so that it is kept as it is.
    names_keep_apart(["<raw>", "'<raw>", "<GOAL>", "<whole>", "-<raw>"], false);
}

fn names_keep_apart(names: [&str; 5], are_said: bool) {
    let mut domain = manipulation();
    domain.predicates.iter_mut().zip(names).for_each(|(predicate, name)| predicate.name = name.into());
    let known: Vec<_> =
        domain.predicates.iter().map(|predicate| (&predicate.name, predicate.parameters.len())).collect();
    let said = |number: usize| {
        let (name, arity) = known[number % known.len()];
        format!("{name}({})", ["a", "b"][..arity].join(", "))
    };
    for layout in [Layout::Difference, Layout::Progress, Layout::Report] {
        let codec = Codec::new(&[(&domain, Synonyms::default())], layout);
        let mut words = codec.vocabulary().words().to_vec();
        words.sort_unstable();
        assert!(words.is_sorted_by(|a, b| a < b));
        for number in 0..known.len() {
            let (one, other) = (said(number), said(number + 1));
            let text = format!(
                "<|startoftext|> <GOAL> {one}, not {other} <INIT> {other} <ACTION> pick(a) <STATE> {one} <|endoftext|>"
            );
            let (words, legend) = codec.encode(&text, &hints());
            assert!(!are_said || legend.exceptions.is_empty(), "{words}");
            assert_eq!(codec.decode(&words, &legend), text);
        }
    }
}

#[test]
fn ids_and_words_agree() {
    let codec = codec(Layout::Difference);
    let all = codec.encode_ids_batch(&[FIGURE_4, TYPED], &Rows::default());
    assert_eq!(codec.vocabulary().join(&all.ids[..all.offsets[1]]), codec.encode(FIGURE_4, &hints()).0);
    assert_eq!(all.prompt_lengths[1], all.offsets[2] - all.offsets[1]);
    assert_eq!(codec.decode_ids(&all.ids[all.offsets[1]..], &all.legends[1]), TYPED);
    let words = codec.vocabulary().with_slots(70_000);
    assert!(words.iter().take(65_000).enumerate().all(|(id, word)| codec.vocabulary().id(word) == Some(id as Word)));
}
