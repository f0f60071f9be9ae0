//! The help of the commands: their flags in groups, with examples. The flags themselves stand in
//! `arguments`. Completions and manual pages come from the same.

use std::fs;
use std::path::Path;

use clap::{Command, CommandFactory};

use super::arguments::{Arguments, CompletionsArguments, ManArguments};
use super::groups::GROUPS;
use super::print;
use crate::{Error, Result};

/// Commands with the flags of a run that write nothing: they refuse those about what is written.
const WRITE_NOTHING: [&str; 5] = ["plan", "check", "verify", "compare", "reproduce"];

/// What stands below the help of a command.
const EXAMPLES: &[(&str, &str)] = &[
    (
        "run",
        "\
Examples:
  pointmill run pipelines/demo.toml
  pointmill run thin.toml --set grid.side=0.25 --set write.path=thin.laz --memory 2GiB
  pointmill run 'read in.laz ! normals ! cells max_angle=6deg ! median ! write out.laz'
  pointmill run pipelines/demo.toml --help

An argument with a `!` between spaces is a pipeline in one line, any other the name of a file.
Relative paths, in the pipeline file too, start from the folder you are in.",
    ),
    (
        "reduce",
        "\
Examples:
  pointmill reduce survey/*.laz -o reduced.laz
  pointmill reduce survey/*.laz -o reduced.laz --keep 10% --report reduced.json
  pointmill reduce survey/*.laz -o reduced.laz --tolerance 5cm
  pointmill reduce survey.laz -o reduced.laz --report reduced.html --accept 'max <= 20cm'
  pointmill reduce survey --outdir reduced --classes 2 --max-side 2
  pointmill reduce part.ply -o part-reduced.ply --preset part --max-angle 6deg
  pointmill reduce survey.laz -o marked.laz --mark key-point --order input

It runs the pipeline pipelines/reduce.toml or, by the published method, pipelines/paper.toml, which
can be copied and changed.",
    ),
    (
        "convert",
        "\
Examples:
  pointmill convert survey/*.las -o survey.laz
  pointmill convert survey/*.las -o compressed/ --to laz
  pointmill convert 'survey/**/*.las' -o compressed/ --to laz --resume --summary done.json
  pointmill convert scan.ply -o scan.laz --scale auto --drop confidence
  pointmill convert scan.laz -o scan.ply --map Amplitude=Intensity --drop Intensity --type X=f32",
    ),
    (
        "cut",
        "\
Examples:
  pointmill reduce survey.laz -o ranked.laz --keep 20% --ranks
  pointmill cut ranked.laz --keep 1M -o small.laz
  pointmill cut ranked.laz --keep 20cm -o even.laz
  pointmill run 'read ranked.laz name=r ! cut keep=1M ! write a.laz'",
    ),
    (
        "verify",
        "\
Examples:
  pointmill verify survey.laz reduced.laz
  pointmill verify survey.laz reduced.laz --tolerance 5cm --max-spacing 1m
  pointmill verify survey/*.laz reduced.laz --json

The exit code is 1 if a record of the reduced scan is none of the original, or a point that was
removed is farther away than it may be.",
    ),
    (
        "compare",
        "\
Examples:
  pointmill compare before.laz after.laz
  pointmill compare before.laz after.copc.laz --accept same
  pointmill compare survey/ reduced.ply --distances --accept 'subset, max <= 20cm'
  pointmill compare front.ply reduced.ply --axis x --pixels 512 --json
  pointmill compare front.ply reduced.ply --normals --accept 'normals.p95 <= 5deg'

Records are compared byte for byte where both scans have one layout, and by the values of the
dimensions that both have elsewhere.

Rules of --accept, between commas: same, same-order, subset (of the records of SECOND in FIRST),
ordered-subset; max, mean, rms, p50, p95 or p99 of the distances, with <= or < and a length, which
imply --distances; normals.max and the others, with an angle, which imply --normals: the larger
figure of both ways counts; and depth.rms, depth.mean, depth.max and depth.ssd, which imply --depth.

In depth images, pixels that have points of one scan alone are counted and not compared.",
    ),
    (
        "reproduce",
        "\
Examples:
  pointmill reproduce reduced.laz
  pointmill reproduce reduced.laz --inputs survey

Outputs say how they were made, unless that was not wanted (--no-provenance): by which pipeline and
version, and of which inputs. These are looked for where they were from the folder of the output,
and must have the SHA-256 that the output says. Nothing is written but scratch beside it.

The exit code is 0 if the bytes are the same, 1 if they are not, and 2 if it cannot be tried.",
    ),
    (
        "info",
        "\
Examples:
  pointmill info scan.laz
  pointmill info --deep scan.laz
  pointmill info --json survey/*.laz",
    ),
    (
        "validate",
        "\
Examples:
  pointmill validate scan.laz
  pointmill validate --json survey/*.laz > findings.json
  pointmill validate survey --quiet

What the rules are is in docs/validate.md. The exit code is 1 if a file has a fault; the others are
looked at all the same.",
    ),
    (
        "picture",
        "\
Examples:
  pointmill picture survey.laz -o survey.png
  pointmill picture survey.laz reduced.laz -o both.png --by class --from south
  pointmill picture 'survey/*.laz' -o survey.png --width 4096

Files of every format that is read are drawn, in memory for the picture alone. Of COPC the levels
alone are read that have a point for every pixel.",
    ),
    (
        "plan",
        "\
Examples:
  pointmill plan pipelines/demo.toml --memory 1GiB --threads 4
  pointmill plan pipelines/demo.toml --json --no-trial

Size of outputs and time are estimated by a trial: the stages run on some 100,000 to 500,000 of the
points. Nothing is written but scratch files, which are gone when it ends.",
    ),
    (
        "check",
        "\
Examples:
  pointmill check pipelines/demo.toml
  pointmill check 'read survey/*.laz ! grid side=\"5 cm\" ! write thin.laz'",
    ),
    ("stages", "Examples:\n  pointmill stages\n  pointmill stages cells\n  pointmill stages run"),
    (
        "graph",
        "\
Examples:
  pointmill graph pipelines/classes.toml
  pointmill graph pipelines/classes.toml --as mermaid
  pointmill graph pipelines/classes.toml --as dot | dot -Tsvg > classes.svg",
    ),
    (
        "explain",
        "\
Examples:
  pointmill explain pipelines/web.toml --set write.path=thin.laz > thin.toml
  pointmill explain 'read in.laz ! normals ! cells ! median ! write out.laz'

What it prints is a pipeline file that does the same. Inputs are not opened.",
    ),
    (
        "new",
        "Examples:\n  pointmill new\n  pointmill new reduce\n  pointmill new grid -o thin.toml",
    ),
    ("schema", "Example:\n  pointmill schema > pipeline.schema.json"),
    ("synth", "Example:\n  pointmill synth als -n 1M -o landscape.laz --seed 7"),
    (
        "completions",
        "Example:
  pointmill completions bash > ~/.local/share/bash-completion/completions/pointmill",
    ),
    ("man", "Examples:\n  pointmill man | man -l -\n  pointmill man ~/.local/share/man/man1"),
];

/// What `--accept` of `compare` is about.
const COMPARE_ACCEPT: &str = "What the two scans must be, such as \"same\" or \
                              \"subset, max <= 5mm\", by the rules below: the exit code is 3 if \
                              they are not";

/// The command line with its flags in groups and its examples.
pub(super) fn command() -> Command {
    let grouped = GROUPS.iter().fold(Arguments::command(), |all, (command, heading, flags)| {
        let group = |sub: Command, flag: &&str| sub.mut_arg(*flag, |a| a.help_heading(*heading));
        all.mut_subcommand(*command, |sub| flags.iter().fold(sub, group))
    });
    let hidden = WRITE_NOTHING.iter().fold(grouped, |all, command| {
        let hide = |sub: Command, flag| sub.mut_arg(flag, |a| a.hide(true));
        all.mut_subcommand(*command, |sub| {
            ["report", "no_clobber", "no_provenance"].into_iter().fold(sub, hide)
        })
    });
    let hidden = hidden
        .mut_subcommand("verify", |of| of.mut_arg("accept", |a| a.hide(true)))
        .mut_subcommand("compare", |of| of.mut_arg("accept", |a| a.help(COMPARE_ACCEPT)));
    EXAMPLES.iter().fold(hidden, |all, (command, examples)| {
        all.mut_subcommand(*command, |sub| sub.after_help(*examples))
    })
}

/// Prints what a shell needs to complete commands and flags.
pub(super) fn completions(arguments: &CompletionsArguments) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut command(), "pointmill", &mut text);
    print::result(String::from_utf8_lossy(&text))
}

/// Prints the manual page of the program, or writes it and one for each command into a folder.
pub(super) fn man(arguments: &ManArguments) -> Result<()> {
    let Some(folder) = &arguments.folder else {
        let mut text = Vec::new();
        let failed = |e| Error::internal("the manual page could not be made").because(e);
        clap_mangen::Man::new(command()).render(&mut text).map_err(failed)?;
        return print::result(String::from_utf8_lossy(&text));
    };
    let folder = Path::new(folder);
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create the folder", e))?;
    let failed = |e| Error::io(folder, "write the manual pages", e);
    clap_mangen::generate_to(command(), folder).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_of_the_large_commands_is_in_a_group() {
        let all = command();
        for name in ["reduce", "convert"] {
            let sub = all.find_subcommand(name).unwrap();
            assert!(sub.get_arguments().count() > 10);
            for flag in sub.get_arguments().filter(|flag| !flag.is_positional()) {
                assert!(
                    flag.get_help_heading().is_some(),
                    "{name}: {} is in no group",
                    flag.get_id()
                );
            }
        }
    }

    #[test]
    fn no_value_is_refused_in_the_words_of_a_parser() {
        let mut tried = 0;
        for sub in command().get_subcommands() {
            let name = sub.get_name();
            for flag in sub.get_arguments().filter(|flag| flag.get_long().is_some()) {
                if !flag.get_action().takes_values() {
                    continue;
                }
                let typed = format!("--{}=?", flag.get_long().unwrap());
                let told = match command().try_get_matches_from(["pointmill", name, &typed]) {
                    Err(told) => told.to_string(),
                    Ok(_) => String::new(),
                };
                for raw in ["invalid digit", "invalid float", "cannot parse", "too large to fit"] {
                    assert!(!told.contains(raw), "{name} {typed}: {told}");
                }
                tried += 1;
            }
        }
        assert!(tried > 50, "{tried} flags");
    }

    /// The words of a line as a shell takes them that knows single quotes alone.
    fn typed(line: &str) -> Vec<String> {
        let parts = line.split('\'').enumerate();
        let words = parts.flat_map(|(n, part)| match n % 2 {
            1 => vec![part.to_owned()],
            _ => part.split_whitespace().map(str::to_owned).collect(),
        });
        words.collect()
    }

    #[test]
    fn every_command_has_an_example_that_can_be_typed() {
        let all = command();
        for sub in all.get_subcommands() {
            let (_, text) = EXAMPLES.iter().find(|(name, _)| *name == sub.get_name()).unwrap();
            let mut lines = text.lines().filter_map(|line| line.strip_prefix("  "));
            let first = lines.next().unwrap();
            for line in std::iter::once(first).chain(lines) {
                let words = typed(line.split(['|', '>']).next().unwrap());
                let taken = command().try_get_matches_from(&words);
                let is_help = words.contains(&"--help".to_owned());
                assert!(taken.is_ok() || is_help, "{line}");
            }
        }
        command().debug_assert();
    }
}
