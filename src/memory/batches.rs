//! Batches that a program makes as they are asked for.

use std::sync::{Arc, Mutex, PoisonError};

use super::records::check;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{OpenSource, Part, Source};
use crate::{Error, Result};

type Iter = Box<dyn Iterator<Item = Result<PointBatch>> + Send>;

/// Batches of an iterator as a source: each is asked for when the run has use for it, once. They
/// are one part, so that one thread reads them; stages behind work on all.
///
/// The receiving end of a bounded channel is such an iterator: the thread that fills it waits for
/// the run.
pub struct Batches {
    schema: Arc<Schema>,
    metadata: Metadata,
    at_most: u64,
    left: Arc<Mutex<Option<Iter>>>,
}

impl Batches {
    /// The batches of `each`, whose records are of `schema`: `at_most` points in all, for which
    /// memory is planned.
    ///
    /// # Errors
    ///
    /// A schema without coordinates.
    pub fn new(
        schema: &Arc<Schema>,
        at_most: u64,
        each: impl Iterator<Item = Result<PointBatch>> + Send + 'static,
    ) -> Result<Batches> {
        check(schema)?;
        let left = Arc::new(Mutex::new(Some(Box::new(each) as Iter)));
        Ok(Batches { schema: schema.clone(), metadata: Metadata::default(), at_most, left })
    }

    /// The same with what outputs carry on besides points, such as the reference system.
    #[must_use]
    pub fn with_metadata(self, metadata: Metadata) -> Batches {
        Batches { metadata, ..self }
    }
}

impl OpenSource for Batches {
    fn open(&self) -> Result<Box<dyn Source>> {
        let (schema, metadata) = (self.schema.clone(), self.metadata.clone());
        Ok(Box::new(Batches { schema, metadata, at_most: self.at_most, left: self.left.clone() }))
    }
}

impl Source for Batches {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn points(&self) -> u64 {
        self.at_most
    }

    fn part_bytes(&self) -> u64 {
        // A batch of the program, of which nothing is known; it is the program's to bound.
        0
    }

    fn parts(&self) -> usize {
        1
    }

    fn part(&self, _: usize) -> Result<Box<dyn Part + '_>> {
        let taken = self.left.lock().unwrap_or_else(PoisonError::into_inner).take();
        let each = taken.ok_or_else(|| {
            Error::pipeline("the batches of this source were read before: they come once")
        })?;
        Ok(Box::new(BatchesPart { source: self, each, open: None, read: 0 }))
    }

    fn is_read_once(&self) -> bool {
        true
    }
}

struct BatchesPart<'a> {
    source: &'a Batches,
    each: Iter,
    /// A batch of the program, and how many of its records were read.
    open: Option<(PointBatch, usize)>,
    read: u64,
}

impl BatchesPart<'_> {
    fn next(&mut self) -> Result<bool> {
        let Some(batch) = self.each.next().transpose()? else { return Ok(false) };
        if batch.schema() != &self.source.schema {
            return Err(Error::pipeline("a batch is of another schema than its source"));
        }
        self.read += batch.len() as u64;
        let most = self.source.at_most;
        if self.read > most {
            let told = format!("the source was to give {most} points at most, and gives more");
            return Err(Error::pipeline(told).help("say how many there may be"));
        }
        self.open = Some((batch, 0));
        Ok(true)
    }
}

impl Part for BatchesPart<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        batch.clear();
        batch.source = 0;
        while batch.len() < batch.capacity() {
            let Some((open, done)) = &mut self.open else {
                match self.next()? {
                    true => continue,
                    false => break,
                }
            };
            let now = (open.len() - *done).min(batch.capacity() - batch.len());
            let stride = open.schema().stride;
            batch.extend(&open.records()[*done * stride..(*done + now) * stride]);
            *done += now;
            if *done == open.len() {
                self.open = None;
            }
        }
        Ok(())
    }
}
