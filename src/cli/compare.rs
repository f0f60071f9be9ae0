//! `compare`: two scans as depth images.

use super::arguments::CompareArguments;
use super::check::{reading, refuse_rules};
use super::console::Console;
use super::flags::compare_flags;
use super::print;
use crate::compare::{DepthSettings, depth_errors};
use crate::language::Registry;
use crate::{Error, Result};

/// Compares two scans and prints what they differ by.
pub(super) fn compare(
    arguments: &CompareArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    refuse_rules(&arguments.common, "compare tells figures, and judges none")?;
    let settings = DepthSettings {
        axis: arguments.axis.into(),
        pixels: arguments.pixels as usize,
        run: reading(&arguments.common, compare_flags(arguments), registry)?,
    };
    console.hear_interrupts();
    let [first, second] = [&arguments.first, &arguments.second].map(|path| vec![path.clone()]);
    let errors =
        console.watched(None, |watch| depth_errors(&first, &second, &settings, registry, watch))?;
    if arguments.json {
        let failed = |e| Error::internal("figures could not be written as JSON").because(e);
        let told = serde_json::to_value(&errors).map_err(failed)?;
        return print::json(&format!("{told:#}"));
    }
    console.result(&errors)
}
