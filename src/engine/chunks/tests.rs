//! Products cut into the chunks of sinks.

use super::*;
use crate::budget::Budget;
use crate::engine::product::RecordEntry;
use crate::engine::row::RowLayout;
use crate::point::{Column, Edit};
use crate::store::{FATE_BYTES, Folder, RecordState, Tag};

#[derive(Debug)]
struct Nowhere;

impl Folder for Nowhere {
    fn file(&self, _name: &str) -> Result<std::path::PathBuf> {
        Err(crate::Error::internal("nothing spills here"))
    }
}

const NUMBER: Column<f64> = Column::new("Number", &[]);

fn product(kept: &[(u64, u32)]) -> Product {
    let entry = |&(number, count): &(u64, u32)| RecordEntry {
        number,
        count,
        tag: Tag::default(),
        was: RecordState::ALIVE,
        now: RecordState::ALIVE,
    };
    Product {
        entries: kept.iter().map(entry).collect(),
        rows: kept.iter().flat_map(|&(first, _)| (first as f64).to_ne_bytes()).collect(),
        fates: vec![0; kept.len() * FATE_BYTES],
        ..Product::default()
    }
}

#[test]
fn chunks_are_cut_by_rank_and_copies_are_one_entry() {
    let area = SpillArea::new(Budget::new(1 << 26), 1 << 26, Box::new(Nowhere));
    let row = RowLayout::of([NUMBER.kind()]);
    let outputs = vec![Open::new(0, 1000, &row, false)];
    let copies = 10_000_000;
    let all = 8 + u64::from(copies);
    let growing = GrowingOutcome::new(&area, 8, all, &[]).unwrap();
    let mut cutter = Cutter::new(growing, row.bytes(), outputs, Lists::default());
    let mut chunks = cutter.cut(&product(&[(0, 1), (1, 2), (7, copies)])).unwrap();
    assert_eq!(chunks.len(), 10_000);
    assert!(chunks.iter().all(|chunk| chunk.records.len() <= 3));
    chunks.extend(cutter.cut(&product(&[(20_000_000, 5)])).unwrap());
    let (rest, stored, _, counts) = cutter.finish().unwrap();
    chunks.extend(rest);
    assert_eq!(counts, Counts { alive: all, written: all, outputs: vec![all] });
    let mut buffer = Vec::new();
    assert_eq!(stored.states.get(all - 3, 3, &mut buffer).unwrap(), [RecordState::ALIVE.0; 3]);
    let (mut numbers, mut states, mut ranks) = (Vec::new(), Vec::new(), 0);
    let expected = (0..3).chain(7..7 + u64::from(copies)).chain(20_000_000..20_000_005);
    let mut expected = expected.peekable();
    for chunk in &chunks {
        chunk.number(&mut numbers);
        assert!(numbers.iter().all(|&number| expected.next() == Some(number)));
        let columns = chunk.columns();
        let values = columns.get(&NUMBER).unwrap();
        chunk.states(&mut states);
        assert_eq!((values.len(), states.len()), (numbers.len(), numbers.len()));
        assert!(numbers.iter().zip(values).all(|(&n, &value)| match n {
            0 => value == 0.0,
            1..3 => value == 1.0,
            7..20_000_000 => value == 7.0,
            _ => value == 2e7,
        }));
        ranks += numbers.len();
        assert!(ranks % 1000 == 0 || expected.peek().is_none());
    }
    assert_eq!(expected.next(), None);
}

#[test]
fn outputs_take_what_was_there_before_the_pass_or_what_it_leaves() {
    let area = SpillArea::new(Budget::new(1 << 20), 1 << 20, Box::new(Nowhere));
    let none = RowLayout::default();
    let outputs = vec![Open::new(3, 2, &none, true), Open::new(5, 2, &none, false)];
    let growing = GrowingOutcome::new(&area, 3, 3, &[]).unwrap();
    let mut cutter = Cutter::new(growing, 0, outputs, Lists::default());
    let mut product = Product { rows: Vec::new(), ..product(&[(0, 1), (1, 1), (2, 1)]) };
    product.entries[1].now = RecordState::REMOVED;
    product.entries[2].now = RecordState::ASIDE.edited(Edit::SetWithheld);
    let mut chunks = cutter.cut(&product).unwrap();
    let (rest, _, _, counts) = cutter.finish().unwrap();
    chunks.extend(rest);
    assert_eq!(counts, Counts { alive: 1, written: 2, outputs: vec![3, 2] });
    let of = |sink: usize| {
        let mut all = Vec::new();
        for chunk in chunks.iter().filter(|chunk| chunk.sink == sink) {
            let (mut numbers, mut states) = (Vec::new(), Vec::new());
            chunk.number(&mut numbers);
            chunk.states(&mut states);
            all.extend(numbers.into_iter().zip(states.into_iter().map(RecordState::edits)));
        }
        all
    };
    assert_eq!(of(3), [(0, 0), (1, 0), (2, 0)]);
    assert_eq!(of(5), [(0, 0), (2, Edit::SetWithheld as u8)]);
}
