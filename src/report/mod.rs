//! What a run says it did: the ledger, the errors of tiles and scan, and how they are merged.

mod tally;

pub use tally::Tally;
