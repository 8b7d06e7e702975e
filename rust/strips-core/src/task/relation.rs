//! Sets of tuples of objects, with indexes: the tables of the join engine.
//!
//! A tuple is named by its row, the order in which it came. Rows lie in one flat array; an open-addressing table of row
//! numbers finds them again, so that a tuple costs its columns and some eight bytes, whatever its arity.

const FREE: u32 = u32::MAX;

/// Distinct tuples of one arity, in the order of their arrival.
#[derive(Clone, Debug)]
pub(super) struct TupleSet {
    arity: usize,
    length: usize,
    columns: Vec<u32>,
    slots: Vec<u32>,
}

impl TupleSet {
    pub fn new(arity: usize) -> Self {
        Self { arity, length: 0, columns: Vec::new(), slots: vec![FREE; 8] }
    }

    pub fn len(&self) -> usize {
        self.length
    }

    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[row * self.arity..(row + 1) * self.arity]
    }

    /// The row of the tuple, if it is there.
    pub fn find(&self, tuple: &[u32]) -> Option<usize> {
        let row = self.slots[self.probe(tuple)];
        (row != FREE).then_some(row as usize)
    }

    /// The row of the tuple, and whether it is new.
    pub fn insert(&mut self, tuple: &[u32]) -> (usize, bool) {
        let slot = self.probe(tuple);
        if self.slots[slot] != FREE {
            return (self.slots[slot] as usize, false);
        }
        let row = self.length;
        self.slots[slot] = row as u32;
        self.columns.extend_from_slice(tuple);
        self.length += 1;
        if self.length * 2 > self.slots.len() {
            self.grow();
        }
        (row, true)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * (self.columns.capacity() + self.slots.capacity())
    }

    /// The slot that holds the tuple, or the free one where it would go.
    fn probe(&self, tuple: &[u32]) -> usize {
        debug_assert_eq!(tuple.len(), self.arity);
        let mask = self.slots.len() - 1;
        let mut slot = hash(tuple) & mask;
        while self.slots[slot] != FREE && self.row(self.slots[slot] as usize) != tuple {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        let mask = self.slots.len() * 2 - 1;
        self.slots = vec![FREE; mask + 1];
        for row in 0..self.length {
            let mut slot = hash(self.row(row)) & mask;
            while self.slots[slot] != FREE {
                slot = (slot + 1) & mask;
            }
            self.slots[slot] = row as u32;
        }
    }
}

/// A multiplicative hash whose low bits depend on every column.
fn hash(tuple: &[u32]) -> usize {
    let mixed = tuple
        .iter()
        .fold(0u64, |hash, &column| (hash.rotate_left(23) ^ u64::from(column)).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    (mixed >> 32) as usize
}

/// The rows of a relation by the values in some of its columns.
#[derive(Clone, Debug)]
struct Index {
    columns: Vec<usize>,
    keys: TupleSet,
    rows: Vec<Vec<u32>>,
}

impl Index {
    fn insert(&mut self, tuple: &[u32], row: usize, key: &mut Vec<u32>) {
        key.clear();
        key.extend(self.columns.iter().map(|&column| tuple[column]));
        let (group, is_new) = self.keys.insert(key);
        if is_new {
            self.rows.push(Vec::new());
        }
        self.rows[group].push(row as u32);
    }
}

/// A set of tuples of which the first `admitted` take part in joins.
#[derive(Clone, Debug)]
pub(super) struct Relation {
    pub tuples: TupleSet,
    /// How many rows the indexes hold.
    pub admitted: usize,
    indexes: Vec<Index>,
    /// How many different values each column has, once somebody asked.
    distinct: Vec<Option<usize>>,
}

impl Relation {
    pub fn new(arity: usize) -> Self {
        Self { tuples: TupleSet::new(arity), admitted: 0, indexes: Vec::new(), distinct: vec![None; arity] }
    }

    /// The index on these columns, made if need be. Only before the first row is admitted.
    pub fn index_on(&mut self, columns: Vec<usize>) -> usize {
        debug_assert_eq!(self.admitted, 0, "indexes are made before rows are admitted");
        if let Some(known) = self.indexes.iter().position(|index| index.columns == columns) {
            return known;
        }
        let keys = TupleSet::new(columns.len());
        self.indexes.push(Index { columns, keys, rows: Vec::new() });
        self.indexes.len() - 1
    }

    /// Puts the next row into the indexes and gives its number.
    pub fn admit(&mut self, scratch: &mut Vec<u32>) -> usize {
        let row = self.admitted;
        for index in &mut self.indexes {
            index.insert(self.tuples.row(row), row, scratch);
        }
        self.admitted += 1;
        row
    }

    /// The group of rows whose indexed columns equal the key.
    pub fn group(&self, index: usize, key: &[u32]) -> Option<usize> {
        self.indexes[index].keys.find(key)
    }

    /// The `nth` row of a group; rows ascend.
    pub fn member(&self, index: usize, group: usize, nth: usize) -> Option<usize> {
        self.indexes[index].rows[group].get(nth).map(|&row| row as usize)
    }

    /// How many different values the column had when first asked.
    pub fn distinct(&mut self, column: usize) -> usize {
        let tuples = &self.tuples;
        *self.distinct[column].get_or_insert_with(|| {
            let mut values = TupleSet::new(1);
            (0..tuples.len()).for_each(|row| {
                values.insert(&[tuples.row(row)[column]]);
            });
            values.len()
        })
    }

    /// Bytes held, approximately.
    pub fn bytes(&self) -> usize {
        let index = |index: &Index| index.keys.bytes() + index.rows.len() * 56 + self.admitted * 6;
        self.tuples.bytes() + self.indexes.iter().map(index).sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tuple_is_kept_once_and_found_again() {
        let mut set = TupleSet::new(2);
        for n in 0..1000 {
            let tuple = [n % 100, n % 7];
            let (row, is_new) = set.insert(&tuple);
            assert_eq!((is_new, set.insert(&tuple)), (n < 700, (row, false)));
        }
        assert_eq!(set.len(), 700);
        assert!((0..700).all(|row| set.find(set.row(row)) == Some(row)));
        assert_eq!(set.find(&[100, 0]), None);
    }

    #[test]
    fn the_empty_tuple_is_a_tuple() {
        let mut set = TupleSet::new(0);
        assert_eq!(set.find(&[]), None);
        assert_eq!((set.insert(&[]), set.insert(&[])), ((0, true), (0, false)));
        assert_eq!((set.len(), set.find(&[])), (1, Some(0)));
    }

    #[test]
    fn an_index_gives_the_rows_of_a_key_in_order() {
        let mut relation = Relation::new(2);
        let index = relation.index_on(vec![1]);
        for n in 0..10 {
            relation.tuples.insert(&[n, n % 3]);
            relation.admit(&mut Vec::new());
        }
        let group = relation.group(index, &[1]).expect("some row has it");
        let rows: Vec<usize> = (0..).map_while(|nth| relation.member(index, group, nth)).collect();
        assert_eq!(rows, [1, 4, 7]);
        assert_eq!((relation.group(index, &[3]), relation.distinct(1)), (None, 3));
    }
}
