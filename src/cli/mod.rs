//! The command line: arguments to pipelines, progress to stderr, results to stdout.
//!
//! Exit codes: 0 done; 1 the run failed (I/O, bad data, over budget); 2 the command or the pipeline
//! is wrong; 130 interrupted (Ctrl-C, or asked to end by a signal).

mod arguments;
mod check;
mod console;
mod convert;
mod describe;
mod events;
mod interrupt;
mod picture;
mod print;
mod progress;
mod run;
mod stages;
mod table;

use std::process::ExitCode;

use clap::Parser;

use crate::pipeline::Registry;
use crate::{Error, ErrorKind, Result};
use arguments::{Arguments, Command};
use console::Console;

/// Runs the command that the process was started with; pipelines may name the kinds of `registry`.
pub fn main(registry: &Registry) -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(told) => {
            let _ = told.print(); // nobody is left to tell that a terminal is gone
            return ExitCode::from(if told.use_stderr() { 2 } else { 0 });
        }
    };
    let console = Console::new(arguments.command.common());
    match execute(&arguments.command, registry, &console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console.error(&error);
            ExitCode::from(exit_number(&error))
        }
    }
}

fn execute(command: &Command, registry: &Registry, console: &Console) -> Result<()> {
    match command {
        Command::Run(arguments) => run::run(arguments, registry, console),
        Command::Reduce(arguments) => run::reduce(arguments, registry, console),
        Command::Convert(arguments) => convert::convert(arguments, registry, console),
        Command::Synth(arguments) => run::synth(arguments, registry, console),
        Command::Plan(arguments) => check::plan(arguments, registry),
        Command::Check(arguments) => check::check(arguments, registry, console),
        Command::Stages(arguments) => stages::stages(arguments, registry),
        Command::Info(arguments) => describe::info(arguments),
        Command::Picture(arguments) => picture::picture(arguments),
    }
}

/// The exit code that an error leads to.
fn exit_number(error: &Error) -> u8 {
    match error.kind() {
        ErrorKind::Io | ErrorKind::Data | ErrorKind::Memory | ErrorKind::Internal => 1,
        ErrorKind::Pipeline => 2,
        ErrorKind::Interrupted => 130,
    }
}
