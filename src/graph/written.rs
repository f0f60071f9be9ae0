//! Where a stage is written, for what turns out to be wrong once the inputs are known.

use crate::Error;
use crate::expression::ExpressionFault;

/// How a stage was written, by whoever made the graph.
pub trait Written: Send + Sync {
    /// An error about the stage, told where it is written.
    fn wrong(&self, told: String) -> Error;

    /// An error about the value of `key`, told where that is written.
    fn wrong_key(&self, key: &str, told: String) -> Error;

    /// The keys that are written, in order, each with its value as a pipeline file has it; none if
    /// no text says which they are.
    fn keys(&self) -> Option<Vec<(String, String)>> {
        None
    }

    /// An error in an expression that is the value of `key` or one of several, told at its place.
    fn wrong_expression(&self, key: &str, text: &str, fault: ExpressionFault) -> Error;
}

/// A stage that a program put there.
pub struct Unwritten(String);

impl Unwritten {
    /// Stage `number`, of this kind.
    pub fn new(kind: &str, number: usize) -> Self {
        Unwritten(format!("stage {number} (`{kind}`)"))
    }
}

impl Written for Unwritten {
    fn wrong(&self, told: String) -> Error {
        Error::pipeline(format!("{}: {told}", self.0))
    }

    fn wrong_key(&self, _: &str, told: String) -> Error {
        self.wrong(told)
    }

    fn wrong_expression(&self, key: &str, text: &str, fault: ExpressionFault) -> Error {
        let error = fault.error(text);
        let told = self.wrong(format!("`{key}`: {error}"));
        match error.remedy() {
            Some(help) => told.help(help.to_owned()),
            None => told,
        }
    }
}
