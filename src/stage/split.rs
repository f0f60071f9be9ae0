//! Into which files an output is split.

use crate::quantity::Figure;

/// Into which files an output is split.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum OutputSplit {
    /// A file for each square of the plane that has points, with this side in the unit of x and y.
    Squares(f64),
    /// A file for each value of this dimension of the records, whose numbers are whole.
    Values(String),
    /// A file for so many records, in the order of the output; the last may have fewer.
    Points(u64),
    /// A file for as many records as fit so many bytes, in the order of the output.
    Bytes(u64),
}

/// Which file of a split: the column and the row of a square, counted in sides from the origin of
/// the coordinates; else a value, or the number of the file from 1, and 0.
pub type SplitKey = [i64; 2];

impl OutputSplit {
    /// What its files are told apart by, in words.
    pub(crate) fn told(&self) -> String {
        match self {
            OutputSplit::Squares(side) => format!("squares of {} have points", Figure(*side)),
            OutputSplit::Values(name) => format!("values of {name} have points"),
            OutputSplit::Points(points) => format!("files of {points} points are to be written"),
            OutputSplit::Bytes(bytes) => format!("files of {bytes} bytes are to be written"),
        }
    }

    /// What makes the files fewer.
    pub(crate) fn remedy(&self) -> &'static str {
        match self {
            OutputSplit::Squares(_) => "give a larger `write.side`",
            OutputSplit::Values(_) => "give a dimension of fewer values in `write.by`",
            OutputSplit::Points(_) => "give a larger `write.points`",
            OutputSplit::Bytes(_) => "give a larger `write.bytes`",
        }
    }
}
