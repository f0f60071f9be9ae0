//! The command line: arguments to pipelines, progress to stderr, results to stdout.
//!
//! Exit codes: 0 done; 1 the run failed (I/O, bad data, over budget); 2 the command or the pipeline
//! is wrong; 3 the result is not accepted by its rules; 130 interrupted (Ctrl-C, or asked to end by
//! a signal).

mod arguments;
mod batch;
mod check;
mod classes;
mod compare;
mod console;
mod convert;
mod deep;
mod describe;
mod draw;
mod events;
mod exit;
mod explain;
mod flags;
mod form;
mod graph;
mod groups;
mod help;
mod interrupt;
mod jobs;
mod mistyped;
mod noise;
mod picture;
mod pipeline;
mod preset;
mod preview;
mod print;
mod progress;
mod reduction;
mod reproduce;
mod run;
mod seen;
mod size;
mod stages;
mod table;
mod validate;
mod verify;
mod words;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::FromArgMatches;
use clap::error::ErrorKind;

use crate::Result;
use crate::error::shown;
use crate::language::Registry;
use arguments::{Arguments, Command};
use console::Console;
use exit::exit_number;

/// What helps where an argument is no text.
const UNREADABLE: &str = "\
    help: rename the file: pipelines and reports could not say its name";

/// Runs the command that the process was started with; pipelines may name the kinds and formats of
/// `registry`.
pub fn main(registry: &Registry) -> ExitCode {
    ExitCode::from(run_with(std::env::args_os().collect(), registry))
}

/// Runs the command that `arguments` are, the first of which is the program's name, as [`main`]
/// does; returns the exit code. It prints as the process would.
pub fn run_with(arguments: Vec<OsString>, registry: &Registry) -> u8 {
    if let Some(odd) = arguments.iter().skip(1).find(|argument| argument.to_str().is_none()) {
        let odd = shown(odd.as_ref());
        print::message(format_args!("error: the argument `{odd}` is not UTF-8 text\n{UNREADABLE}"));
        return 2;
    }
    let known = help::command();
    let given = mistyped::tied(&known, arguments);
    let typed = known.clone().try_get_matches_from(&given);
    let arguments = match typed.and_then(|typed| Arguments::from_arg_matches(&typed)) {
        Ok(arguments) => arguments,
        Err(told) => {
            let given: Vec<OsString> =
                given.iter().map(|argument| shown(argument.as_ref()).to_string().into()).collect();
            let told = as_shown(told, &known, &given);
            match mistyped::told(&told, &known, &given, registry.formats()) {
                Some(told) => print::message(told),
                None => print::usage(&told),
            }
            return match told.kind() {
                ErrorKind::DisplayHelp => parameters(&known, &given, registry),
                _ if told.use_stderr() => 2,
                _ => 0,
            };
        }
    };
    let console = Console::new(&arguments.command, registry);
    match execute(&arguments.command, registry, &console) {
        Ok(()) => 0,
        Err(error) => {
            console.error(&error);
            exit_number(&error)
        }
    }
}

/// Prints the parameters of the pipeline that help was asked for, if it was for one; returns the
/// exit code.
fn parameters(known: &clap::Command, given: &[OsString], registry: &Registry) -> u8 {
    let rest = given.iter().filter(|argument| *argument != "--help" && *argument != "-h");
    let typed = known.clone().try_get_matches_from(rest);
    let Ok(Arguments { command }) = typed.and_then(|typed| Arguments::from_arg_matches(&typed))
    else {
        return 0; // help of a command, and of no pipeline
    };
    let Some(arguments) = command.pipeline() else { return 0 };
    match pipeline::parameters(arguments, registry).and_then(print::result) {
        Ok(()) => 0,
        Err(error) => {
            Console::new(&command, registry).error(&error);
            exit_number(&error)
        }
    }
}

/// The same error with the arguments as they may be printed: what is typed is quoted in it.
fn as_shown(told: clap::Error, known: &clap::Command, shown: &[OsString]) -> clap::Error {
    known.clone().try_get_matches_from(shown).err().unwrap_or(told)
}

fn execute(command: &Command, registry: &Registry, console: &Console) -> Result<()> {
    match command {
        Command::Run(arguments) => run::run(arguments, registry, console),
        Command::Reduce(arguments) => run::reduce(arguments, registry, console),
        Command::Convert(arguments) => convert::convert(arguments, registry, console),
        Command::Synth(arguments) => run::synth(arguments, registry, console),
        Command::Cut(arguments) => run::cut(arguments, registry, console),
        Command::Verify(arguments) => verify::check_reduction(arguments, registry, console),
        Command::Compare(arguments) => compare::compare_scans(arguments, registry, console),
        Command::Reproduce(arguments) => reproduce::make_again(arguments, registry, console),
        Command::Plan(arguments) => check::plan(arguments, registry, console),
        Command::Check(arguments) => check::check(arguments, registry, console),
        Command::Stages(arguments) => stages::stages(arguments, registry),
        Command::Graph(arguments) => graph::graph(arguments, registry),
        Command::Explain(arguments) => explain::explain(arguments, registry),
        Command::New(arguments) => jobs::new(arguments),
        Command::Schema => stages::schema(registry),
        Command::Info(arguments) => describe::info(arguments, registry.formats(), console),
        Command::Validate(arguments) => validate::validate(arguments, registry.formats(), console),
        Command::Picture(arguments) => picture::picture(arguments, registry.formats()),
        Command::Completions(arguments) => help::completions(arguments),
        Command::Man(arguments) => help::man(arguments),
    }
}
