//! `compare`: two scans beside each other.

use super::arguments::{CommonArguments, CompareArguments};
use super::check::{reading, refuse_outputs};
use super::console::Console;
use super::flags::compare_flags;
use super::print;
use crate::compare::{CompareRules, CompareSettings, compare};
use crate::language::Registry;
use crate::{Error, Result};

/// Compares two scans and prints what they differ by; fails if that is not accepted.
pub(super) fn compare_scans(
    arguments: &CompareArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    refuse_outputs(&arguments.common)?;
    let accept = arguments.common.accept.as_deref().map(rules).transpose()?;
    // Rules are on the comparison, and not on the runs that read the scans.
    let common = CommonArguments { accept: None, ..arguments.common.clone() };
    let run = reading(&common, compare_flags(arguments), registry)?;
    let settings = CompareSettings {
        noise: arguments.noise.as_ref().and(run.noise),
        withheld: arguments.withheld.as_ref().map(|_| run.withheld),
        distances: arguments.distances,
        normals: arguments.normals,
        depth: arguments.depth(),
        accept,
        run,
    };
    console.hear_interrupts();
    let [first, second] = [&arguments.first, &arguments.second].map(|path| vec![path.clone()]);
    let told =
        console.watched(None, |watch| compare(&first, &second, &settings, registry, watch))?;
    if arguments.json {
        let failed = |e| Error::internal("figures could not be written as JSON").because(e);
        let json = serde_json::to_value(&told).map_err(failed)?;
        print::json(&format!("{json:#}"))?;
    } else {
        console.result(&told)?;
    }
    told.accepted()
}

/// The rules as they are typed.
fn rules(text: &str) -> Result<CompareRules> {
    CompareRules::parse(text).map_err(|error| {
        let told = format!("--accept: {error}");
        let help = error.remedy().map(str::to_owned);
        let error = Error::pipeline(told);
        help.into_iter().fold(error, |error, help| error.help(help))
    })
}
