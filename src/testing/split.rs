//! A source of the records of a made scan, which come in as many parts and batches as one likes.

use std::ops::Range;
use std::sync::Arc;

use super::made::MadeScan;
use crate::Result;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{OpenSource, Part, Source};

/// Records in parts of about the same size, read in batches.
#[derive(Debug, Clone)]
pub(super) struct SplitSource {
    pub scan: MadeScan,
    pub metadata: Metadata,
    /// How many parts there are, each as if of a file of its own.
    pub parts: usize,
    /// Records that a part gives at once, at most.
    pub batch: usize,
}

impl OpenSource for SplitSource {
    fn open(&self) -> Result<Box<dyn Source>> {
        Ok(Box::new(self.clone()))
    }
}

impl SplitSource {
    /// The records of part `index`; parts differ in size, and some may be empty.
    fn records(&self, index: usize) -> Range<usize> {
        let (len, parts) = (self.scan.len(), self.parts);
        let begin = |index: usize| len * index * index / (parts * parts);
        begin(index)..begin(index + 1)
    }
}

impl Source for SplitSource {
    fn schema(&self) -> &Arc<Schema> {
        &self.scan.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn points(&self) -> u64 {
        self.scan.len() as u64
    }

    fn part_bytes(&self) -> u64 {
        0
    }

    fn parts(&self) -> usize {
        self.parts
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        Some(self.records(index).start as u64)
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let (stride, records) = (self.scan.schema.stride, self.records(index));
        let rest = &self.scan.records[records.start * stride..records.end * stride];
        Ok(Box::new(SplitPart { rest, number: index as u32, batch: self.batch }))
    }
}

struct SplitPart<'a> {
    rest: &'a [u8],
    number: u32,
    batch: usize,
}

impl Part for SplitPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.clear();
        batch.source = self.number;
        let most = self.batch.min(batch.capacity()) * batch.schema().stride;
        let (now, later) = self.rest.split_at(self.rest.len().min(most));
        batch.extend(now);
        self.rest = later;
        Ok(())
    }
}
