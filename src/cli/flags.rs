//! Flags and the settings that they stand for, in one table a command. Pipelines take their values
//! from it, and messages their words.

use serde_json::{Value, json};

use super::arguments::{Common, Convert, Filtered, Reduce, Synth, Written};
use super::classes::Classes;
use crate::language::Set;
use crate::quantity::parse_count;

/// A flag of a command, the setting that it stands for, and its value if it was given.
pub(super) struct Flag {
    /// As it is typed: `--keep`, or `IN` for an argument without dashes.
    pub name: &'static str,
    /// As `--set` takes it: `cells.keep`.
    pub address: &'static str,
    /// What was given.
    pub given: Option<Given>,
}

/// The value of a flag.
pub(super) struct Given {
    value: Value,
    /// What was typed, where the value may be written otherwise: `6`, a number, is 6.0.
    typed: Option<String>,
}

impl Given {
    /// The value that `text` was typed for.
    pub fn of(text: &str, value: Value) -> Given {
        Given { value, typed: Some(text.to_owned()) }
    }
}

impl<T: Into<Value>> From<T> for Given {
    fn from(value: T) -> Given {
        Given { value: value.into(), typed: None }
    }
}

/// Flags from `(name, address, what was given)`.
fn flags<const N: usize>(rows: [(&'static str, &'static str, Option<Given>); N]) -> Vec<Flag> {
    rows.into_iter().map(|(name, address, given)| Flag { name, address, given }).collect()
}

/// The values that were given in several tables of flags, for a pipeline.
pub(super) fn given<const N: usize>(tables: [Vec<Flag>; N]) -> Vec<Set> {
    let set = |flag: Flag| {
        let Given { value, typed } = flag.given?;
        let set = Set::argument(flag.name, flag.address, value);
        Some(match typed {
            Some(typed) => set.typed(typed),
            None => set,
        })
    };
    tables.into_iter().flatten().filter_map(set).collect()
}

/// The flags that stand for `[run]` settings.
pub(super) fn common_flags(common: &Common) -> Vec<Flag> {
    let existing = common.no_clobber.then(|| Given::from("refuse"));
    flags([
        ("--memory", "run.memory", common.memory.clone().map(Given::from)),
        ("--threads", "run.threads", common.threads.as_deref().map(whole_or_text)),
        ("--scratch", "run.scratch", common.scratch.clone().map(Given::from)),
        ("--report", "run.report", common.report.clone().map(Given::from)),
        ("--no-clobber", "run.existing", existing),
    ])
}

impl Filtered {
    /// True if any points are to be left out.
    pub fn is_given(&self) -> bool {
        !self.keep_classes.is_empty() || !self.drop_classes.is_empty()
    }
}

/// Which points are left out, as the keys of `filter`.
fn filtered(arguments: &Filtered) -> Vec<Flag> {
    flags([
        ("--keep-classes", "filter.keep_classes", classes(&arguments.keep_classes)),
        ("--drop-classes", "filter.drop_classes", classes(&arguments.drop_classes)),
    ])
}

/// What becomes of noise: left out, unless all points are to be written, or noise is asked for.
fn noise(arguments: &Reduce) -> &str {
    let mut asked = arguments.classes.iter().chain(&arguments.filter.keep_classes);
    match &arguments.noise {
        Some(noise) => noise,
        None if asked.any(|classes| classes.has(7) || classes.has(18)) => "keep",
        None if arguments.mark.is_some() => "ignore",
        None => "drop",
    }
}

/// True if what is left is to be reduced again and nothing says by what: a number would be met at once.
fn again(arguments: &Reduce) -> bool {
    let passes = arguments.passes.as_deref().and_then(|passes| parse_count(passes).ok());
    let limit = arguments.keep.is_some() || arguments.max_angle.is_some();
    passes.is_some_and(|passes| passes > 1) && !limit && arguments.preset.is_none()
}

/// The flags of `reduce`.
pub(super) fn reduce_flags(arguments: &Reduce) -> Vec<Flag> {
    let classes = || classes(&arguments.classes);
    let mut all = flags([
        ("IN", "read.path", Some(json!(arguments.inputs).into())),
        ("-o", "write.path", arguments.output.clone().map(Given::from)),
        ("--outdir", "write.folder", arguments.outdir.clone().map(Given::from)),
        ("--to", "write.format", arguments.to.clone().map(Given::from)),
        ("--max-angle", "cells.max_angle", arguments.max_angle.as_deref().map(number_or_text)),
        ("--keep", "cells.keep", arguments.keep.as_deref().map(whole_or_text)),
        ("--max-side", "cells.max_side", arguments.max_side.as_deref().map(number_or_text)),
        (
            "--min-spacing",
            "cells.min_spacing",
            arguments.min_spacing.as_deref().map(number_or_text),
        ),
        ("--measure", "cells.measure", arguments.measure.clone().map(Given::from)),
        ("--reference", "cells.reference", arguments.reference.as_deref().map(numbers_or_text)),
        ("--neighbors", "normals.neighbors", arguments.neighbors.as_deref().map(whole_or_text)),
        ("--side", "cells.side", arguments.side.as_deref().map(number_or_text)),
        ("--min-points", "cells.min_points", arguments.min_points.as_deref().map(whole_or_text)),
        ("--split", "cells.split", arguments.split.clone().map(Given::from)),
        ("--method", "normals.method", arguments.method.clone().map(Given::from)),
        ("--passes", "median.passes", arguments.passes.as_deref().map(whole_or_text)),
        ("--passes", "cells.max_angle", again(arguments).then(|| "auto".into())),
        ("--order", "write.order", arguments.order.clone().map(Given::from)),
        ("--mark", "median.mark", arguments.mark.as_deref().map(whole_or_text)),
        ("--classes", "outliers.classes", classes().filter(|_| arguments.outliers)),
        ("--classes", "normals.classes", classes()),
        ("--classes", "cells.classes", classes()),
        ("--classes", "median.classes", classes()),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(Given::from)),
        ("--noise", "run.noise", Some(noise(arguments).into())),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(Given::from)),
        ("--lattice", "run.lattice", arguments.lattice.as_deref().map(number_or_text)),
        ("--headers", "run.headers", arguments.headers.clone().map(Given::from)),
        ("--z-scale", "run.z_scale", arguments.z_scale.as_deref().map(number_or_text)),
    ]);
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// The flags of `convert`, for a run that reads and writes these.
pub(super) fn convert_flags(
    arguments: &Convert,
    inputs: Option<Value>,
    output: Option<Value>,
) -> Vec<Flag> {
    let mut all = flags([
        ("IN", "read.path", inputs.map(Given::from)),
        ("-o", "write.path", output.map(Given::from)),
        ("--to", "write.format", arguments.to.clone().map(Given::from)),
        ("--headers", "run.headers", arguments.headers.clone().map(Given::from)),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(Given::from)),
    ]);
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// The flags of `synth`.
pub(super) fn synth_flags(arguments: &Synth) -> Vec<Flag> {
    flags([
        ("KIND", "synth.scene", Some(arguments.scene.clone().into())),
        ("-n", "synth.points", Some(whole_or_text(&arguments.points))),
        ("-o", "write.path", Some(arguments.output.clone().into())),
        ("--seed", "synth.seed", arguments.seed.as_deref().map(whole_or_text)),
        ("--noise", "synth.noise", arguments.noise.as_deref().map(number_or_text)),
    ])
}

/// How the output is written, as the keys of `write`.
fn written(arguments: &Written) -> Vec<Flag> {
    let names = (!arguments.drop.is_empty()).then(|| json!(arguments.drop).into());
    flags([
        ("--scale", "write.scale", arguments.scale.as_deref().map(numbers_or_text)),
        ("--offset", "write.offset", arguments.offset.as_deref().map(numbers_or_text)),
        ("--drop", "write.drop", names),
        ("--encoding", "write.encoding", arguments.encoding.clone().map(Given::from)),
        ("--colors", "write.colors", arguments.colors.clone().map(Given::from)),
    ])
}

/// All classes of several numbers and ranges.
fn classes(given: &[Classes]) -> Option<Given> {
    let all: Vec<u8> = given.iter().flat_map(Classes::each).collect();
    let typed: Vec<String> = given.iter().map(Classes::to_string).collect();
    (!all.is_empty()).then(|| Given::of(&typed.join(","), json!(all)))
}

/// A whole number where the text is one (`10k`, `1e1`), else a number or the text.
fn whole_or_text(text: &str) -> Given {
    match parse_count(text) {
        Ok(count) => Given::of(text, count.into()),
        // As a float it would be told in other digits than were typed.
        Err(_) if is_too_large(text) => Given::of(text, json!(text.trim())),
        Err(_) => number_or_text(text),
    }
}

/// True for a whole number that no integer holds.
fn is_too_large(text: &str) -> bool {
    let digits = text.trim().trim_start_matches(['-', '+']);
    digits.len() > 15 && digits.chars().all(|c| c.is_ascii_digit())
}

/// A number where the text is one, else the text (`6deg`, `auto`).
fn number_or_text(text: &str) -> Given {
    Given::of(text, plain(text))
}

/// A list of numbers where the text has commas (what is no number there is told), else a number or the
/// text (`x`).
fn numbers_or_text(text: &str) -> Given {
    let list = || text.split(',').map(plain).collect();
    Given::of(text, if text.contains(',') { list() } else { plain(text) })
}

/// A number as a pipeline's value; one that JSON cannot hold is left for the stage to refuse.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or_else(|| json!(value.to_string()), Value::from)
}

fn plain(text: &str) -> Value {
    let text = text.trim();
    match text.parse::<i64>() {
        Ok(whole) => whole.into(),
        Err(_) => text.parse().map_or_else(|_| json!(text), number),
    }
}
