//! `compare`: two scans as depth images.

use super::arguments::CompareArguments;
use super::check::refuse_outputs;
use super::console::Console;
use super::flags::{common_flags, compare_flags, given};
use super::mistyped::marked;
use super::pipeline::HIDDEN;
use super::print;
use crate::compare::{DepthSettings, depth_errors};
use crate::graph::Graph;
use crate::language::Registry;
use crate::{Error, Result};

/// What the settings of a run are read with.
const SETTINGS: &str = "[[stage]]\nkind = \"read\"\n\n[[stage]]\nkind = \"discard\"\n";

/// Compares two scans and prints what they differ by.
pub(super) fn compare(
    arguments: &CompareArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    refuse_outputs(&arguments.common)?;
    if let Some(rules) = &arguments.common.accept {
        let told = marked("--accept: is for commands that reduce or write", rules, "");
        return Err(Error::pipeline(told).help("compare tells figures, and judges none"));
    }
    let sets = given([compare_flags(arguments), common_flags(&arguments.common)]);
    let settings = DepthSettings {
        axis: arguments.axis.into(),
        pixels: arguments.pixels as usize,
        run: Graph::parse_with(SETTINGS, HIDDEN, registry, &sets)?.settings,
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
