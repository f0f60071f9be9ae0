//! `reproduce`: does the run that made a file give it again?

use super::arguments::ReproduceArguments;
use super::check::refuse_outputs;
use super::console::Console;
use super::draw::{Nothing, watched};
use super::flags::{common_flags, given};
use super::pipeline::HIDDEN;
use super::print;
use crate::compare::{ReproduceSettings, reproduce};
use crate::error::shown;
use crate::graph::Graph;
use crate::language::Registry;
use crate::{Error, ErrorKind, Result};

/// What the settings of a run are read with.
const SETTINGS: &str = "\
[[stage]]
kind = \"synth\"
scene = \"plane\"
points = 1

[[stage]]
kind = \"discard\"
";

/// Makes the run of an output again and prints whether the bytes are the same; fails if they are
/// not.
pub(super) fn make_again(
    arguments: &ReproduceArguments,
    registry: &Registry,
    console: &Console,
) -> Result<()> {
    refuse_outputs(&arguments.common)?;
    let output = &arguments.output;
    let sets = given([common_flags(&arguments.common)]);
    let settings = ReproduceSettings {
        inputs: arguments.inputs.clone(),
        run: Graph::parse_with(SETTINGS, HIDDEN, registry, &sets)?.settings,
    };
    console.hear_interrupts();
    let came_to = watched(&mut Nothing, &|| console.cancelled(), |watch| {
        reproduce(output, &settings, registry, watch)
    })?;
    if arguments.json {
        let failed = |e| Error::internal("a comparison could not be written as JSON").because(e);
        let told = serde_json::to_value(&came_to).map_err(failed)?;
        print::json(&format!("{told:#}"))?;
    } else if came_to.same {
        console.result(format_args!("{} is reproduced: {came_to}", shown(output)))?;
    }
    match came_to.same {
        true => Ok(()),
        false => {
            let told = format!("the run that made it gives {came_to}");
            Err(Error::new(ErrorKind::Data, told).at(output))
        }
    }
}
