//! What every stage promises.

use std::fmt;

/// What a stage promises, and what a check holds it to. As a text each goes on from "it".
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Promise {
    /// Its kind says how it works, on tiles or streaming, and it does so.
    Role,
    /// It gives an answer or an error that says what is wrong with the input; it does not panic.
    Answers,
    /// Two runs that are the same in everything give the same.
    Time,
    /// Every record is kept, or removed and entered in the ledger under the stage's kind.
    Ledger,
    /// It writes no dimension, column or position but those that its needs name.
    Changes,
    /// It reads no dimension, column or class but those that its needs name.
    Reads,
    /// It looks at no more neighbours and no wider cells than its needs say.
    Reach,
    /// Where tiles are cut, and whether it streams in the decode or behind tiles, decides nothing.
    Tiles,
    /// The order of the input decides nothing, unless its needs say that it reads the numbers of
    /// records.
    Order,
    /// The files, parts and batches that the input comes in decide nothing.
    Split,
    /// The number of threads decides nothing.
    Threads,
    /// The instruction set that a run computes by decides nothing.
    Instructions,
    /// The memory that a run may use decides nothing.
    Budget,
    /// A run that is stopped leaves nothing behind, and the next gives what it would have given.
    Stops,
    /// It works with no more memory than its needs say.
    Memory,
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Promise::Role => "plays the role that its kind names",
            Promise::Answers => "gives an answer, or says what is wrong with the input",
            Promise::Time => "does not depend on time or chance",
            Promise::Ledger => "accounts for every record",
            Promise::Changes => "changes only what it declares",
            Promise::Reads => "reads only what it declares",
            Promise::Reach => "looks no further than it says",
            Promise::Tiles => "does not depend on tiles",
            Promise::Order => "does not depend on the order of the records",
            Promise::Split => "does not depend on how the input is split",
            Promise::Threads => "does not depend on threads",
            Promise::Instructions => "does not depend on the instruction set",
            Promise::Budget => "does not depend on the memory of the run",
            Promise::Stops => "leaves nothing behind when a run is stopped",
            Promise::Memory => "keeps to the memory it declares",
        })
    }
}
