//! Flags and the settings that they stand for, in one table a command. Pipelines take their values
//! from it, and messages their words.

use serde_json::{Value, json};

use super::arguments::{
    CommonArguments, CompareArguments, ConvertArguments, CutArguments, FilterArguments,
    ReadArguments, ReduceArguments, SynthArguments, VerifyArguments, WrittenArguments,
};
use super::classes::Classes;
use crate::language::Set;
use crate::ops::KEEP_RANK;
use crate::quantity::{Length, parse_count};
use crate::report::ACCEPT_RULES;

/// A flag of a command, the setting that it stands for, and its value if it was given.
pub(super) struct CommandFlag {
    /// As it is typed: `--keep`, or `IN` for an argument without dashes.
    pub name: &'static str,
    /// As `--set` takes it: `cells.keep`.
    pub address: &'static str,
    /// What was given.
    pub given: Option<FlagValue>,
}

/// The value of a flag.
pub(super) struct FlagValue {
    value: Value,
    /// What was typed, where the value may be written otherwise: `6`, a number, is 6.0.
    typed: Option<String>,
}

impl FlagValue {
    /// The value that `text` was typed for.
    pub fn of(text: &str, value: Value) -> FlagValue {
        FlagValue { value, typed: Some(text.to_owned()) }
    }

    /// The text that it is, if it is one.
    pub fn text(&self) -> Option<&str> {
        self.value.as_str()
    }
}

impl<T: Into<Value>> From<T> for FlagValue {
    fn from(value: T) -> FlagValue {
        FlagValue { value: value.into(), typed: None }
    }
}

/// Flags from `(name, address, what was given)`.
pub(super) fn flags<const N: usize>(
    rows: [(&'static str, &'static str, Option<FlagValue>); N],
) -> Vec<CommandFlag> {
    rows.into_iter().map(|(name, address, given)| CommandFlag { name, address, given }).collect()
}

/// The values that were given in several tables of flags, for a pipeline.
pub(super) fn given<const N: usize>(tables: [Vec<CommandFlag>; N]) -> Vec<Set> {
    let set = |flag: CommandFlag| {
        let FlagValue { value, typed } = flag.given?;
        let set = Set::argument(flag.name, flag.address, value);
        Some(match typed {
            Some(typed) => set.typed(typed),
            None => set,
        })
    };
    tables.into_iter().flatten().filter_map(set).collect()
}

/// The flags that stand for settings of `[run]` and `[accept]`.
pub(super) fn common_flags(common: &CommonArguments) -> Vec<CommandFlag> {
    let provenance = common.no_provenance.then(|| FlagValue::from(false));
    let existing = common.no_clobber.then(|| FlagValue::from("refuse"));
    flags([
        ("--memory", "run.memory", common.memory.clone().map(FlagValue::from)),
        ("--threads", "run.threads", common.threads.as_deref().map(whole_or_text)),
        ("--scratch", "run.scratch", common.scratch.clone().map(FlagValue::from)),
        ("--report", "run.report", common.report.clone().map(FlagValue::from)),
        ("--accept", ACCEPT_RULES, common.accept.clone().map(FlagValue::from)),
        ("--no-clobber", "run.existing", existing),
        ("--no-provenance", "run.provenance", provenance),
    ])
}

/// The flags of commands that read points without a run.
pub(super) fn walk_flags() -> Vec<CommandFlag> {
    flags([("--memory", "run.memory", None), ("--threads", "run.threads", None)])
}

impl FilterArguments {
    /// True if any points are to be left out.
    pub fn is_given(&self) -> bool {
        !self.keep_classes.is_empty() || !self.drop_classes.is_empty()
    }
}

/// Which points are left out, as the keys of `filter`.
fn filtered(arguments: &FilterArguments) -> Vec<CommandFlag> {
    flags([
        ("--keep-classes", "filter.keep_classes", classes(&arguments.keep_classes)),
        ("--drop-classes", "filter.drop_classes", classes(&arguments.drop_classes)),
    ])
}

/// What becomes of noise: left out, unless all points are to be written, or noise is asked for.
fn noise(arguments: &ReduceArguments) -> &str {
    let mut asked = arguments.classes.iter().chain(&arguments.filter.keep_classes);
    match &arguments.noise {
        Some(noise) => noise,
        None if asked.any(|classes| classes.has(7) || classes.has(18)) => "keep",
        None if arguments.mark.is_some() => "ignore",
        None => "drop",
    }
}

/// True if what is left is to be reduced again and nothing says by what: a number would be met at
/// once.
fn again(arguments: &ReduceArguments) -> bool {
    let passes = arguments.passes.as_deref().and_then(|passes| parse_count(passes).ok());
    let limit = arguments.keep.is_some() || arguments.max_angle.is_some();
    passes.is_some_and(|passes| passes > 1) && !limit && arguments.preset.is_none()
}

/// The flags of `reduce`.
pub(super) fn reduce_flags(arguments: &ReduceArguments) -> Vec<CommandFlag> {
    let by_cells = arguments.by_cells();
    let ranks = !by_cells && (arguments.ranks || arguments.tolerance.is_some());
    let classes = |of_cells: bool| classes(&arguments.classes).filter(|_| of_cells == by_cells);
    let keep = arguments.keep.as_deref().map(whole_or_text).filter(|_| by_cells);
    let mut all = flags([
        ("IN", "read.path", Some(json!(arguments.inputs).into())),
        ("-o", "write.path", arguments.output.clone().map(FlagValue::from)),
        ("--outdir", "write.folder", arguments.outdir.clone().map(FlagValue::from)),
        ("--to", "write.format", arguments.to.clone().map(FlagValue::from)),
        ("--max-angle", "cells.max_angle", arguments.max_angle.as_deref().map(number_or_text)),
        ("--keep", "cells.keep", keep),
        ("--max-side", "cells.max_side", arguments.max_side.as_deref().map(number_or_text)),
        (
            "--min-spacing",
            "cells.min_spacing",
            arguments.min_spacing.as_deref().map(number_or_text),
        ),
        ("--measure", "cells.measure", arguments.measure.clone().map(FlagValue::from)),
        ("--reference", "cells.reference", arguments.reference.as_deref().map(numbers_or_text)),
        ("--neighbors", "normals.neighbors", arguments.neighbors.as_deref().map(whole_or_text)),
        ("--side", "cells.side", arguments.side.as_deref().map(number_or_text)),
        ("--min-points", "cells.min_points", arguments.min_points.as_deref().map(whole_or_text)),
        ("--split", "cells.split", arguments.split.clone().map(FlagValue::from)),
        ("--method", "normals.method", arguments.method.clone().map(FlagValue::from)),
        ("--passes", "median.passes", arguments.passes.as_deref().map(whole_or_text)),
        ("--passes", "cells.max_angle", again(arguments).then(|| "auto".into())),
        ("--order", "write.order", arguments.order.clone().map(FlagValue::from)),
        ("--mark", "median.mark", arguments.mark.as_deref().map(whole_or_text)),
        ("--classes", "outliers.classes", classes(by_cells).filter(|_| arguments.outliers)),
        ("--classes", "normals.classes", classes(true)),
        ("--classes", "cells.classes", classes(true)),
        ("--classes", "median.classes", classes(true)),
        ("--classes", "graded.classes", classes(false)),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(FlagValue::from)),
        ("--noise", "run.noise", Some(noise(arguments).into())),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(FlagValue::from)),
        ("--lattice", "run.lattice", arguments.lattice.as_deref().map(number_or_text)),
        ("--headers", "run.headers", arguments.headers.clone().map(FlagValue::from)),
        ("--z-scale", "run.z_scale", arguments.z_scale.as_deref().map(number_or_text)),
    ]);
    if !by_cells {
        all.extend(graded_flags(arguments, ranks));
    }
    if ranks {
        let dimensions = Some(json!([KEEP_RANK.kind().name()]).into());
        all.extend(flags([("--ranks", "write.dimensions", dimensions)]));
    }
    all.extend(read(&arguments.read));
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// Those of them that stand for keys of `graded`.
fn graded_flags(arguments: &ReduceArguments, ranks: bool) -> Vec<CommandFlag> {
    let length = |given: &Option<String>| given.as_deref().map(number_or_text);
    flags([
        ("--keep", "graded.keep", arguments.keep.as_deref().map(whole_or_text)),
        ("--tolerance", "graded.tolerance", length(&arguments.tolerance)),
        ("--max-spacing", "graded.max_spacing", length(&arguments.max_spacing)),
        ("--weight", "graded.weight", arguments.weight.clone().map(FlagValue::from)),
        ("--borders", "graded.borders", arguments.borders.then(|| FlagValue::from(true))),
        ("--ranks", "graded.ranks", ranks.then(|| FlagValue::from(true))),
        ("--effort", "graded.effort", arguments.effort.clone().map(FlagValue::from)),
    ])
}

/// The flags of `convert`, for a run that reads and writes these.
pub(super) fn convert_flags(
    arguments: &ConvertArguments,
    inputs: Option<Value>,
    output: Option<Value>,
) -> Vec<CommandFlag> {
    let mut all = flags([
        ("IN", "read.path", inputs.map(FlagValue::from)),
        ("-o", "write.path", output.map(FlagValue::from)),
        ("--to", "write.format", arguments.to.clone().map(FlagValue::from)),
        ("--headers", "run.headers", arguments.headers.clone().map(FlagValue::from)),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(FlagValue::from)),
    ]);
    all.extend(read(&arguments.read));
    all.extend(filtered(&arguments.filter));
    all.extend(written(&arguments.written));
    all
}

/// The flags of `cut`. A length with a unit is told from a number.
pub(super) fn cut_flags(arguments: &CutArguments) -> Vec<CommandFlag> {
    let is_length = |keep: &&str| Length::read(keep).is_some();
    let keep = arguments.keep.as_deref();
    let spacing = arguments.spacing.as_deref().or(keep.filter(is_length));
    flags([
        ("IN", "read.path", Some(arguments.input.clone().into())),
        ("-o", "write.path", Some(arguments.output.clone().into())),
        ("--keep", "cut.keep", keep.filter(|keep| !is_length(keep)).map(whole_or_text)),
        ("--spacing", "cut.spacing", spacing.map(number_or_text)),
    ])
}

/// The flags of `verify`: settings of the run that it is, and names of its own lengths.
pub(super) fn verify_flags(arguments: &VerifyArguments) -> Vec<CommandFlag> {
    flags([
        ("ORIGINAL", "read.path", Some(json!(arguments.files().1).into())),
        ("--tolerance", "verify.tolerance", None),
        ("--max-spacing", "verify.max_spacing", None),
        ("--noise", "run.noise", Some(arguments.noise.as_deref().unwrap_or("drop").into())),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(FlagValue::from)),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(FlagValue::from)),
    ])
}

/// The flags of `compare`, as those of `verify`.
pub(super) fn compare_flags(arguments: &CompareArguments) -> Vec<CommandFlag> {
    flags([
        ("FIRST", "read.path", Some(json!([arguments.first]).into())),
        ("--pixels", "compare.pixels", None),
        ("--noise", "run.noise", Some(arguments.noise.as_deref().unwrap_or("drop").into())),
        ("--withheld", "run.withheld", arguments.withheld.clone().map(FlagValue::from)),
        ("--nonfinite", "run.nonfinite", arguments.nonfinite.clone().map(FlagValue::from)),
    ])
}

/// The flags of `synth`.
pub(super) fn synth_flags(arguments: &SynthArguments) -> Vec<CommandFlag> {
    flags([
        ("KIND", "synth.scene", Some(arguments.scene.clone().into())),
        ("-n", "synth.points", Some(whole_or_text(&arguments.points))),
        ("-o", "write.path", Some(arguments.output.clone().into())),
        ("--seed", "synth.seed", arguments.seed.as_deref().map(whole_or_text)),
        ("--noise", "synth.noise", arguments.noise.as_deref().map(number_or_text)),
        ("--front", "synth.front", arguments.front.clone().map(FlagValue::from)),
        ("--noise-in", "synth.noise_in", arguments.noise_in.clone().map(FlagValue::from)),
        ("--outliers", "synth.outliers", arguments.outliers.as_deref().map(number_or_text)),
    ])
}

/// How the inputs are read, as the keys of `read`.
fn read(arguments: &ReadArguments) -> Vec<CommandFlag> {
    let columns = arguments.columns.clone().map(FlagValue::from);
    let numbers: Vec<Value> = arguments.scans.iter().map(|text| plain(text)).collect();
    let scans =
        (!numbers.is_empty()).then(|| FlagValue::of(&arguments.scans.join(","), json!(numbers)));
    let assumed = !arguments.assume.is_empty();
    flags([
        ("--from", "read.format", arguments.from.clone().map(FlagValue::from)),
        ("--columns", "read.columns", columns),
        ("--scans", "read.scans", scans),
        ("--crs", "read.crs", arguments.crs.clone().map(FlagValue::from)),
        ("--reproject", "read.reproject", arguments.reproject.clone().map(FlagValue::from)),
        ("--box", "read.box", arguments.bounds.as_deref().map(numbers_or_text)),
        ("--resolution", "read.resolution", arguments.resolution.as_deref().map(number_or_text)),
        ("--on-error", "read.on_error", arguments.on_error.clone().map(FlagValue::from)),
        ("--assume", "read.assume", assumed.then(|| json!(arguments.assume).into())),
    ])
}

/// How the output is written, as the keys of `write`.
fn written(arguments: &WrittenArguments) -> Vec<CommandFlag> {
    let list = |given: &[String]| (!given.is_empty()).then(|| json!(given).into());
    let names = list(&arguments.drop);
    flags([
        ("--scale", "write.scale", arguments.scale.as_deref().map(numbers_or_text)),
        ("--offset", "write.offset", arguments.offset.as_deref().map(numbers_or_text)),
        (
            "--point-format",
            "write.point_format",
            arguments.point_format.as_deref().map(whole_or_text),
        ),
        ("--drop", "write.drop", names),
        ("--map", "write.map", list(&arguments.map)),
        ("--type", "write.types", list(&arguments.types)),
        ("--intensity", "write.intensity", arguments.intensity.clone().map(FlagValue::from)),
        ("--encoding", "write.encoding", arguments.encoding.clone().map(FlagValue::from)),
        ("--colors", "write.colors", arguments.colors.clone().map(FlagValue::from)),
        ("--separator", "write.separator", arguments.separator.clone().map(FlagValue::from)),
        ("--decimals", "write.decimals", arguments.decimals.as_deref().map(whole_or_text)),
        ("--header", "write.header", arguments.header.map(|is| json!(is).into())),
    ])
}

/// All classes of several numbers and ranges.
fn classes(given: &[Classes]) -> Option<FlagValue> {
    let all: Vec<u8> = given.iter().flat_map(Classes::each).collect();
    let typed: Vec<String> = given.iter().map(Classes::to_string).collect();
    (!all.is_empty()).then(|| FlagValue::of(&typed.join(","), json!(all)))
}

/// A whole number where the text is one (`10k`, `1e1`), else a number or the text.
pub(super) fn whole_or_text(text: &str) -> FlagValue {
    match parse_count(text) {
        Ok(count) => FlagValue::of(text, count.into()),
        // As a float it would be told in other digits than were typed.
        Err(_) if is_too_large(text) => FlagValue::of(text, json!(text.trim())),
        Err(_) => number_or_text(text),
    }
}

/// True for a whole number that no integer holds.
fn is_too_large(text: &str) -> bool {
    let digits = text.trim().trim_start_matches(['-', '+']);
    digits.len() > 15 && digits.chars().all(|c| c.is_ascii_digit())
}

/// A number where the text is one, else the text (`6deg`, `auto`).
fn number_or_text(text: &str) -> FlagValue {
    FlagValue::of(text, plain(text))
}

/// A list of numbers where the text has commas (what is no number there is told), else a number or
/// the text (`x`).
pub(super) fn numbers_or_text(text: &str) -> FlagValue {
    let list = || text.split(',').map(plain).collect();
    FlagValue::of(text, if text.contains(',') { list() } else { plain(text) })
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
