//! When two problems are the same but for names: a canonical form of small coloured structures.
//!
//! Colour refinement on objects (Weisfeiler and Leman's first dimension, over atoms instead of edges), then
//! individualisation and refinement: while some colour is shared, each object of the first smallest shared colour is
//! singled out in turn, and the least encoding over all leaves is the form. Objects that a mere exchange leaves
//! indistinguishable (identical distractors) are tried once, without which six of them would cost 720 leaves.
//!
//! Two structures have equal forms exactly when an isomorphism maps one to the other. Exponential in theory; on
//! planning problems refinement leaves a handful of leaves.

/// Coloured objects and labelled tuples of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Structure {
    /// One colour an object; an isomorphism keeps it. The same colour means the same thing in every structure.
    pub colours: Vec<u32>,
    /// Label and objects of each tuple; an isomorphism keeps the label. Read as a multiset.
    pub tuples: Vec<(u32, Vec<u32>)>,
}

impl Structure {
    /// The same words for every structure isomorphic to this one, and for no other.
    pub fn canonical_form(&self) -> Vec<u32> {
        let (occurrences, mut best) = (Occurrences::new(self), None);
        self.search(&occurrences, &occurrences.refine(self.initial_colours()), &mut best);
        let mut form = best.expect("the search reaches a leaf");
        let mut colours = self.colours.clone();
        colours.sort_unstable();
        form.extend(colours);
        form.push(self.colours.len() as u32);
        form
    }

    /// Colours as ranks 0, 1, …, in the order of the given ones.
    fn initial_colours(&self) -> Vec<u32> {
        ranks(self.colours.len(), |object| &self.colours[object..=object])
    }

    fn search(&self, occurrences: &Occurrences, colours: &[u32], best: &mut Option<Vec<u32>>) {
        let Some(cell) = first_smallest_shared(colours) else {
            let leaf = self.encode(colours);
            if best.as_ref().is_none_or(|known| leaf < *known) {
                *best = Some(leaf);
            }
            return;
        };
        let mut tried: Vec<usize> = Vec::new();
        for &object in &cell {
            if !tried.iter().any(|&other| self.exchangeable(object, other)) {
                tried.push(object);
                self.search(occurrences, &occurrences.refine(single_out(colours, object)), best);
            }
        }
    }

    /// Whether exchanging the two objects maps the tuples to themselves.
    fn exchangeable(&self, a: usize, b: usize) -> bool {
        let exchange = |object: u32| match object as usize {
            object if object == a => b as u32,
            object if object == b => a as u32,
            _ => object,
        };
        let touched = |objects: &[u32]| objects.iter().any(|&o| o as usize == a || o as usize == b);
        let mut before: Vec<_> = self.tuples.iter().filter(|(_, objects)| touched(objects)).cloned().collect();
        let image = |(label, objects): &(u32, Vec<u32>)| (*label, objects.iter().map(|&o| exchange(o)).collect());
        let mut after: Vec<(u32, Vec<u32>)> = before.iter().map(image).collect();
        before.sort_unstable();
        after.sort_unstable();
        before == after
    }

    /// The tuples with each object's colour, now its own, for its name.
    fn encode(&self, colours: &[u32]) -> Vec<u32> {
        let image = |(label, objects): &(u32, Vec<u32>)| {
            let mut words = vec![*label, objects.len() as u32];
            words.extend(objects.iter().map(|&object| colours[object as usize]));
            words
        };
        let mut tuples: Vec<Vec<u32>> = self.tuples.iter().map(image).collect();
        tuples.sort_unstable();
        tuples.into_iter().flatten().collect()
    }
}

/// Each place of each tuple, by the object that stands there.
struct Occurrences<'s> {
    /// Position of the tuple, and place in it.
    places: Vec<(u32, u32)>,
    /// Where each object's places begin, and where the last ones end.
    starts: Vec<usize>,
    tuples: &'s [(u32, Vec<u32>)],
}

impl<'s> Occurrences<'s> {
    fn new(structure: &'s Structure) -> Self {
        let tuples = &structure.tuples[..];
        let mut starts = vec![0; structure.colours.len() + 1];
        tuples.iter().flat_map(|(_, objects)| objects).for_each(|&object| starts[object as usize + 1] += 1);
        (1..starts.len()).for_each(|object| starts[object] += starts[object - 1]);
        let (mut next, mut places) = (starts.clone(), vec![(0, 0); starts[starts.len() - 1]]);
        for (number, (_, objects)) in tuples.iter().enumerate() {
            for (place, &object) in objects.iter().enumerate() {
                places[next[object as usize]] = (number as u32, place as u32);
                next[object as usize] += 1;
            }
        }
        Self { places, starts, tuples }
    }

    /// Splits colours by what tuples an object stands in, at which place and beside which colours, until none splits.
    fn refine(&self, mut colours: Vec<u32>) -> Vec<u32> {
        let mut signatures = Signatures::default();
        loop {
            signatures.write(self, &colours);
            let next = ranks(colours.len(), |object| signatures.of(object));
            if count(&next) == count(&colours) {
                return next;
            }
            colours = next;
        }
    }
}

/// For each object its colour, then its occurrences, sorted. Holds its room from one round to the next.
#[derive(Default)]
struct Signatures {
    words: Vec<u32>,
    /// Where each object's words end.
    ends: Vec<usize>,
    /// One object's occurrences before they are sorted, and where each lies.
    loose: Vec<u32>,
    parts: Vec<std::ops::Range<usize>>,
}

impl Signatures {
    fn of(&self, object: usize) -> &[u32] {
        let start = if object == 0 { 0 } else { self.ends[object - 1] };
        &self.words[start..self.ends[object]]
    }

    fn write(&mut self, occurrences: &Occurrences<'_>, colours: &[u32]) {
        self.words.clear();
        self.ends.clear();
        for (object, &colour) in colours.iter().enumerate() {
            self.words.push(colour);
            self.add_occurrences(occurrences, object, colours);
            self.ends.push(self.words.len());
        }
    }

    fn add_occurrences(&mut self, occurrences: &Occurrences<'_>, object: usize, colours: &[u32]) {
        let Self { words, loose, parts, .. } = self;
        loose.clear();
        parts.clear();
        for &(number, place) in &occurrences.places[occurrences.starts[object]..occurrences.starts[object + 1]] {
            let (label, objects) = &occurrences.tuples[number as usize];
            let start = loose.len();
            loose.extend([*label, place, objects.len() as u32]);
            loose.extend(objects.iter().map(|&other| colours[other as usize]));
            parts.push(start..loose.len());
        }
        parts.sort_unstable_by(|a, b| loose[a.clone()].cmp(&loose[b.clone()]));
        for part in parts.iter() {
            words.extend_from_slice(&loose[part.clone()]);
        }
    }
}

/// 128 bits that stand for the canonical form; collisions are as likely as for any good 128-bit hash.
pub fn canonical_hash(structure: &Structure) -> u128 {
    let form = structure.canonical_form();
    let lane = |seed: u64| form.iter().fold(seed, |hash, &word| scramble(hash ^ u64::from(word)));
    u128::from(lane(0x243F_6A88_85A3_08D3)) << 64 | u128::from(lane(0x1319_8A2E_0370_7344))
}

fn scramble(word: u64) -> u64 {
    let word = word.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}

/// Each key's rank among the distinct keys.
fn ranks<'k>(count: usize, key: impl Fn(usize) -> &'k [u32]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_unstable_by(|&a, &b| key(a).cmp(key(b)));
    let (mut ranks, mut rank) = (vec![0; count], 0);
    for pair in order.windows(2) {
        rank += u32::from(key(pair[0]) != key(pair[1]));
        ranks[pair[1]] = rank;
    }
    ranks
}

fn count(ranks: &[u32]) -> u32 {
    ranks.iter().max().map_or(0, |&rank| rank + 1)
}

/// The objects of the colour that fewest (but at least two) objects share, the first such colour.
fn first_smallest_shared(colours: &[u32]) -> Option<Vec<usize>> {
    let mut sizes = vec![0usize; count(colours) as usize];
    for &colour in colours {
        sizes[colour as usize] += 1;
    }
    let (colour, _) = sizes.iter().enumerate().filter(|&(_, &size)| size > 1).min_by_key(|&(_, &size)| size)?;
    Some((0..colours.len()).filter(|&object| colours[object] as usize == colour).collect())
}

/// Makes room below the object's colour and gives it the lower one.
fn single_out(colours: &[u32], object: usize) -> Vec<u32> {
    let mut doubled: Vec<u32> = colours.iter().map(|&colour| 2 * colour + 1).collect();
    doubled[object] -= 1;
    doubled
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use proptest::prelude::*;

    fn renamed(structure: &Structure, to: &[u32]) -> Structure {
        let mut colours = vec![0; structure.colours.len()];
        (0..to.len()).for_each(|object| colours[to[object] as usize] = structure.colours[object]);
        let image = |(label, objects): &(u32, Vec<u32>)| (*label, objects.iter().map(|&o| to[o as usize]).collect());
        let mut tuples: Vec<_> = structure.tuples.iter().map(image).collect();
        tuples.reverse();
        Structure { colours, tuples }
    }

    fn isomorphic(a: &Structure, b: &Structure) -> bool {
        let mut wanted = b.tuples.clone();
        wanted.sort_unstable();
        permutations(a.colours.len()).into_iter().any(|to| {
            let mut image = renamed(a, &to);
            image.tuples.sort_unstable();
            image.colours == b.colours && image.tuples == wanted
        })
    }

    fn permutations(n: usize) -> Vec<Vec<u32>> {
        if n == 0 {
            return vec![vec![]];
        }
        let longer = |shorter: Vec<u32>| {
            (0..n).map(move |at| {
                let mut longer = shorter.clone();
                longer.insert(at, n as u32 - 1);
                longer
            })
        };
        permutations(n - 1).into_iter().flat_map(longer).collect()
    }

    fn structures() -> impl Strategy<Value = Structure> {
        (1usize..6).prop_flat_map(|n| {
            let object = 0..n as u32;
            let tuple = (0u32..2, proptest::collection::vec(object, 0..3));
            (proptest::collection::vec(0u32..2, n), proptest::collection::vec(tuple, 0..7))
                .prop_map(|(colours, tuples)| Structure { colours, tuples })
        })
    }

    proptest! {
        #[test]
        fn renaming_keeps_the_form(structure in structures(), seed: u64) {
            let mut to: Vec<u32> = (0..structure.colours.len() as u32).collect();
            Random::new(seed, 0).shuffle(&mut to);
            prop_assert_eq!(renamed(&structure, &to).canonical_form(), structure.canonical_form());
        }

        #[test]
        fn equal_forms_mean_isomorphic(a in structures(), b in structures()) {
            let same = a.colours.len() == b.colours.len() && isomorphic(&a, &b);
            prop_assert_eq!(a.canonical_form() == b.canonical_form(), same);
        }
    }

    #[test]
    fn refinement_alone_would_confuse_two_triangles_with_a_hexagon() {
        let ring = |edges: &[(u32, u32)]| Structure {
            colours: vec![0; 6],
            tuples: edges.iter().flat_map(|&(a, b)| [(0, vec![a, b]), (0, vec![b, a])]).collect(),
        };
        let hexagon = ring(&[(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)]);
        let triangles = ring(&[(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3)]);
        assert_ne!(hexagon.canonical_form(), triangles.canonical_form());
    }

    #[test]
    fn twelve_identical_distractors_cost_little() {
        let structure = Structure { colours: vec![0; 13], tuples: (1..13).map(|o| (0, vec![o, 0])).collect() };
        assert_ne!(canonical_hash(&structure), 0);
    }
}
