//! What an output says of the run that it came out of, so that the run can be made again. Knows
//! neither pipelines nor hashes.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::{Error, Result};

/// A text of which only the length is known until the run has read all of its inputs: a sink makes
/// room for the draft when it writes its header, and puts the settled text there when it finishes.
#[derive(Clone)]
pub struct RunNote {
    draft: Arc<str>,
    settle: Arc<dyn Settle>,
    settled: OnceLock<Arc<str>>,
}

/// What knows the text in the end.
pub(crate) trait Settle: Send + Sync {
    /// The text, which has as many bytes as its draft.
    ///
    /// # Errors
    ///
    /// What keeps it from being known, such as an input that changed.
    fn settle(&self) -> Result<Arc<str>>;
}

/// A text that is known from the beginning.
struct Known(Arc<str>);

impl Settle for Known {
    fn settle(&self) -> Result<Arc<str>> {
        Ok(self.0.clone())
    }
}

impl RunNote {
    /// The note that says `text`.
    pub fn new(text: &str) -> Self {
        RunNote::drafted(text.into(), Arc::new(Known(text.into())))
    }

    /// The note that is drafted as `draft` and says in the end what `settle` does.
    pub(crate) fn drafted(draft: Arc<str>, settle: Arc<dyn Settle>) -> Self {
        RunNote { draft, settle, settled: OnceLock::new() }
    }

    /// A text of the same length, which stands in its place until it is settled.
    pub fn draft(&self) -> &str {
        &self.draft
    }

    /// What it says. The first call may have to read what is left of the inputs.
    ///
    /// # Errors
    ///
    /// Inputs that cannot be read to their end, or that changed meanwhile.
    pub fn text(&self) -> Result<&str> {
        if self.settled.get().is_none() {
            let text = self.settle.settle()?;
            if text.len() != self.draft.len() {
                return Err(Error::internal("a note has another length than its draft"));
            }
            // Whoever else settled it meanwhile has the same.
            let _ = self.settled.set(text);
        }
        self.settled.get().map(|text| &**text).ok_or_else(|| Error::internal("a note is unsettled"))
    }
}

impl fmt::Debug for RunNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("RunNote").field(&self.settled.get().unwrap_or(&self.draft)).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Settled(Result<&'static str>);

    impl Settle for Settled {
        fn settle(&self) -> Result<Arc<str>> {
            match &self.0 {
                Ok(text) => Ok((*text).into()),
                Err(error) => Err(Error::internal(error.to_string())),
            }
        }
    }

    #[test]
    fn a_note_is_of_the_length_of_its_draft_or_an_error() {
        let of = |text| RunNote::drafted("000".into(), Arc::new(Settled(text)));
        let note = of(Ok("abc"));
        assert_eq!((note.draft(), note.text().unwrap()), ("000", "abc"));
        assert!(of(Ok("abcd")).text().unwrap_err().to_string().contains("length"));
        let told = of(Err(Error::internal("it changed"))).text().unwrap_err();
        assert!(told.to_string().contains("it changed"), "{told}");
        assert_eq!(RunNote::new("as it is").text().unwrap(), "as it is");
    }
}
