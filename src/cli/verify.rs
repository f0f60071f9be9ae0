//! `verify`: is a scan a reduction of another, and how true is it?

use super::arguments::VerifyArguments;
use super::check::{reading, refuse_rules};
use super::console::Console;
use super::flags::verify_flags;
use super::print;
use crate::compare::{VerifySettings, verify};
use crate::language::Registry;
use crate::{Error, ErrorKind, Result};

/// Checks a reduced scan beside its original and prints what came of it; fails if it does not hold.
pub(super) fn check_reduction(
    arguments: &VerifyArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    refuse_rules(&arguments.common, "give --tolerance and --max-spacing here")?;
    let (Some(reduced), original) = arguments.files() else {
        let told = "a reduced scan is compared with its original, and one file is given";
        let help = "give the original's files first, and the reduced one last";
        return Err(Error::pipeline(told).help(help));
    };
    let settings = VerifySettings {
        tolerance: arguments.tolerance,
        max_spacing: arguments.max_spacing,
        run: reading(&arguments.common, verify_flags(arguments), registry)?,
    };
    console.hear_interrupts();
    let verdict =
        console.watched(None, |watch| verify(original, reduced, &settings, registry, watch))?;
    if arguments.json {
        let failed = |e| Error::internal("a verdict could not be written as JSON").because(e);
        let told = serde_json::to_value(&verdict).map_err(failed)?;
        print::json(&format!("{told:#}"))?;
    } else {
        console.result(&verdict)?;
    }
    match verdict.holds() {
        true => Ok(()),
        false => Err(Error::new(ErrorKind::Data, "the reduced scan does not hold").at(reduced)),
    }
}
