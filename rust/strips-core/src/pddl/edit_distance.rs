//! The nearest of many names to a misspelt one.

/// The candidate nearest to `name` by edit distance (insert, delete, replace, swap neighbours), if any is near enough
/// to be what was meant: about a third of the name's length, none for single letters. The first of equals.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let wanted: Vec<char> = name.chars().collect();
    let limit = wanted.len().div_ceil(3).min(wanted.len() / 2);
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates {
        let bound = best.map_or(limit, |(distance, _)| distance - 1);
        if let Some(distance) = distance_within(&wanted, candidate, bound) {
            best = Some((distance, candidate));
        }
        if matches!(best, Some((0, _))) {
            break;
        }
    }
    best.map(|(_, candidate)| candidate.to_owned())
}

/// The optimal-string-alignment distance, if it is at most `limit`.
fn distance_within(wanted: &[char], candidate: &str, limit: usize) -> Option<usize> {
    let other: Vec<char> = candidate.chars().collect();
    if wanted.len().abs_diff(other.len()) > limit {
        return None;
    }
    let mut rows = [Vec::new(), (0..=other.len()).collect::<Vec<_>>()];
    for i in 0..wanted.len() {
        let row = next_row(wanted, &other, i, &rows);
        let [_, last] = rows;
        rows = [last, row];
    }
    rows[1].last().copied().filter(|&distance| distance <= limit)
}

fn next_row(wanted: &[char], other: &[char], i: usize, rows: &[Vec<usize>; 2]) -> Vec<usize> {
    let [before, last] = rows;
    let mut row = vec![i + 1];
    for j in 0..other.len() {
        let replaced = last[j] + usize::from(wanted[i] != other[j]);
        let mut cost = replaced.min(last[j + 1] + 1).min(row[j] + 1);
        if i > 0 && j > 0 && wanted[i] == other[j - 1] && wanted[i - 1] == other[j] {
            cost = cost.min(before[j - 1] + 1);
        }
        row.push(cost);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn the_nearest_name_is_found_and_a_far_one_is_not() {
        assert_eq!(nearest("holdnig", ["handempty", "holding"]).as_deref(), Some("holding"));
        assert_eq!(nearest("on", ["in", "ontable"]).as_deref(), Some("in"));
        assert_eq!(nearest("clear", ["holding", "on"]), None);
        assert_eq!(nearest("x", ["y"]), None);
    }
}
