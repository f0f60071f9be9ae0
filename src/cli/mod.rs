//! The command line: arguments to pipelines, progress to stderr, results to stdout.
//!
//! Exit codes: 0 done; 1 the run failed (I/O, bad data, over budget); 2 the command or the pipeline
//! is wrong; 130 interrupted (Ctrl-C, or asked to end by a signal).

mod arguments;
mod convert;
mod describe;
mod interrupt;
mod print;
mod progress;
mod run;
mod table;

use std::process::ExitCode;

use clap::Parser;

use crate::pipeline::Registry;
use crate::{Error, ErrorKind, Result};
use arguments::{Arguments, Command};

/// Runs the command that the process was started with; pipelines may name the kinds of `registry`.
pub fn main(registry: &Registry) -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(told) => {
            let _ = told.print(); // nobody is left to tell that a terminal is gone
            return ExitCode::from(if told.use_stderr() { 2 } else { 0 });
        }
    };
    match execute(arguments.command, registry) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print::error(&error);
            exit_code(&error)
        }
    }
}

fn execute(command: Command, registry: &Registry) -> Result<()> {
    match command {
        Command::Run(arguments) => run::run(&arguments, registry),
        Command::Reduce(arguments) => run::reduce(&arguments, registry),
        Command::Convert(arguments) => convert::convert(&arguments, registry),
        Command::Synth(arguments) => run::synth(&arguments, registry),
        Command::Plan(arguments) => run::plan(&arguments, registry),
        Command::Info(arguments) => describe::info(&arguments),
    }
}

fn exit_code(error: &Error) -> ExitCode {
    ExitCode::from(match error.kind() {
        ErrorKind::Io | ErrorKind::Data | ErrorKind::Memory | ErrorKind::Internal => 1,
        ErrorKind::Pipeline => 2,
        ErrorKind::Interrupted => 130,
    })
}
