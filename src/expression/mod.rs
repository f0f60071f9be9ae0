//! Conditions and values over the dimensions of records and the columns that stages compute, as
//! pipelines write them: `Classification in [2, 6] and not Withheld`, `UserData = Intensity / 256`.
//!
//! - Names are those of dimensions (`Z`, `Intensity`, `Classification`; coordinates in world units)
//!   and of numbers of columns (`NormalZ`). A name with spaces stands in backticks.
//! - Conditions are comparisons (`==`, `!=`, `<`, `<=`, `>`, `>=`, in a row as in `1 <= Z < 2`),
//!   memberships (`in [2, 6, 9..12]`, `in 2..6`, ends included), `is nan`, flags on their own, and
//!   what `and`, `or`, `not` and parentheses make of them.
//! - Numbers are written out, or made by `+`, `-`, `*`, `/`, `%` (the remainder has the sign of the
//!   dividend) and the functions `abs`, `sqrt`, `floor`, `ceil`, `round`, `min`, `max`. All are
//!   computed as `f64`, to the same bits everywhere; whole numbers above 2^53 are rounded.
//! - NaN is equal to nothing, below nothing and above nothing.
//!
//! ```
//! use pointmill::expression::Condition;
//!
//! let ground = Condition::parse("Classification == 2 and Z < 400")?;
//! assert_eq!(ground.names(), ["Classification", "Z"]);
//! let wrong = Condition::parse("Classification = 2").unwrap_err();
//! assert_eq!(wrong.remedy(), Some("write `==`"));
//! # Ok::<(), pointmill::Error>(())
//! ```

mod assignment;
mod bind;
mod choice;
mod condition;
mod eval;
mod fault;
mod key;
mod lanes;
mod lexer;
mod named;
mod parser;
mod rules;
mod text;
mod tree;
mod weight;

#[cfg(test)]
mod tests;

pub use assignment::Assignment;
pub(crate) use bind::Names;
pub(crate) use choice::{Choice, choose};
pub use condition::{BoundCondition, Condition};
pub(crate) use fault::ExpressionFault;
pub use key::KeyExpression;
pub(crate) use named::NamedField;
pub use text::OneOrSeveral;
pub(crate) use text::{FromText, ONE_OR_SEVERAL, deserialize as deserialize_text, is_its_text};
pub use weight::Weight;
