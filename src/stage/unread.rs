//! Stages of pipelines that are shown and never run.

use std::path::PathBuf;

use super::Transform;
use super::needs::Needs;
use super::source::{OpenSource, Source};
use crate::point::PointBatch;
use crate::report::Tally;
use crate::{Error, Result};

/// A source or a transform that stands for one whose files were not looked at, in a pipeline that
/// is drawn or explained ([`StagePlace::is_unread`](super::StagePlace::is_unread)).
#[derive(Debug, Clone, Default)]
pub struct Unread {
    /// Files that it would read, as they were written.
    pub paths: Vec<PathBuf>,
}

impl Unread {
    fn refused(&self) -> Error {
        Error::internal("a pipeline that was read to be shown cannot run")
    }
}

impl OpenSource for Unread {
    fn open(&self) -> Result<Box<dyn Source>> {
        Err(self.refused())
    }

    fn paths(&self) -> Vec<PathBuf> {
        self.paths.clone()
    }
}

impl Transform for Unread {
    fn needs(&self) -> Needs {
        Needs::none()
    }

    fn apply(&self, _batch: &mut PointBatch, _tally: &mut Tally) -> Result<()> {
        Err(self.refused())
    }
}
