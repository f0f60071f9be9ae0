//! Mistakes in arguments that clap finds, told as those that pipelines find: what is wrong with
//! which argument, what was typed with a caret below it, and what to type instead.

use std::ffi::OsString;
use std::fs;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command};

use crate::error::nearest;
use crate::stage::Formats;

/// The arguments of the process with every value that begins with a minus and a digit tied to its
/// option (`--max-side=-2m`): it is a value, which the option may refuse, and no option of its own.
pub(super) fn tied(all: &Command, arguments: Vec<OsString>) -> Vec<OsString> {
    let Some(command) = subcommand(all, &arguments) else { return arguments };
    let mut out: Vec<OsString> = Vec::new();
    let mut is_over = false;
    for argument in arguments {
        is_over |= argument == "--";
        let option = out.last().and_then(|last| last.to_str());
        match (option, argument.to_str()) {
            (Some(option), Some(value))
                if !is_over && is_negative(value) && takes_value(command, option) =>
            {
                let tied = format!("{option}={value}");
                out.pop();
                out.push(tied.into());
            }
            _ => out.push(argument),
        }
    }
    out
}

fn subcommand<'a>(all: &'a Command, arguments: &[OsString]) -> Option<&'a Command> {
    arguments.iter().skip(1).find_map(|argument| all.find_subcommand(argument))
}

fn is_negative(value: &str) -> bool {
    let digits = value.strip_prefix('-').map(|rest| rest.strip_prefix('.').unwrap_or(rest));
    digits.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
}

fn takes_value(command: &Command, option: &str) -> bool {
    let is_named = |argument: &&Arg| match option.strip_prefix("--") {
        Some(long) => argument.get_long() == Some(long),
        None => option.strip_prefix('-').is_some_and(|short| {
            argument.get_short().is_some_and(|known| short == known.to_string())
        }),
    };
    command.get_arguments().find(is_named).is_some_and(|found| found.get_action().takes_values())
}

/// The message for what clap found in the arguments `typed`; None if it is told best by clap: help,
/// and what has no place.
pub(super) fn told(
    error: &clap::Error,
    all: &Command,
    typed: &[OsString],
    formats: &Formats,
) -> Option<String> {
    let command = subcommand(all, typed).unwrap_or(all);
    let argument = context(error, ContextKind::InvalidArg);
    let name = argument.split_whitespace().next().unwrap_or_default();
    let value = context(error, ContextKind::InvalidValue);
    Some(match error.kind() {
        ErrorKind::ValueValidation => {
            let cause = std::error::Error::source(error).map(ToString::to_string);
            message(&format!("{name}: {}", cause.unwrap_or_default()), &value, "")
        }
        ErrorKind::InvalidValue if value.is_empty() => {
            let lacks = argument.split_whitespace().nth(1).unwrap_or("a value");
            message(&format!("{name} needs a value: {lacks}"), name, "")
        }
        ErrorKind::InvalidValue => {
            let valid = contexts(error, ContextKind::ValidValue);
            let near = meant(nearest(&value, &valid).into_iter());
            let note = format!("{near}valid: {}", valid.join(", "));
            message(&format!("{name}: cannot be `{value}`"), &value, &note)
        }
        ErrorKind::UnknownArgument if argument.starts_with('-') => {
            let told = format!("`{}` has no {argument}", command.get_name());
            let like = like(command, &argument);
            let note = match like.is_empty() {
                true => format!("`pointmill {} --help` lists its options", command.get_name()),
                false => meant(like.iter()).trim_end().to_owned(),
            };
            message(&told, &argument, &note)
        }
        ErrorKind::UnknownArgument => {
            let told = format!("`{}` takes no more arguments", command.get_name());
            let is_line = typed.iter().any(|word| word == "!");
            let note =
                if is_line { "put the whole pipeline in quotes: 'read IN ! …'" } else { "" };
            message(&told, &argument, note)
        }
        ErrorKind::TooManyValues => message(&format!("{name}: takes no value"), &value, ""),
        ErrorKind::InvalidSubcommand => {
            unknown_command(&context(error, ContextKind::InvalidSubcommand), all)
        }
        ErrorKind::MissingRequiredArgument => {
            let lacking = lacking(command, &contexts(error, ContextKind::InvalidArg));
            let told = format!("error: `{}` needs {lacking}", command.get_name());
            let help = output(typed, formats).filter(|_| lacking.contains("--output"));
            told + &help.map_or(String::new(), |help| format!("\nhelp: {help}"))
        }
        ErrorKind::ArgumentConflict => conflict(name, &contexts(error, ContextKind::PriorArg)),
        _ => return None,
    })
}

fn unknown_command(word: &str, all: &Command) -> String {
    let names: Vec<String> =
        all.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let near = meant(nearest(word, &names).into_iter());
    let note = format!("{near}commands: {}", names.join(", "));
    message(&format!("there is no command `{word}`"), word, &note)
}

/// What is told of an argument that does not go with others, or with itself.
fn conflict(name: &str, others: &[String]) -> String {
    let others: Vec<&str> =
        others.iter().filter_map(|other| other.split_whitespace().next()).collect();
    match others.contains(&name) {
        true => message(&format!("{name} is given twice"), name, ""),
        false => format!(
            "error: {name} and {} do not go together\nhelp: leave one of them out",
            others.join(", ")
        ),
    }
}

/// What is needed, each with what can be given in its place.
fn lacking(command: &Command, needed: &[String]) -> String {
    let folder = command.get_arguments().any(|argument| argument.get_long() == Some("outdir"));
    let each = |needed: &String| match needed.starts_with("--output") && folder {
        true => format!("{needed} or --outdir <DIR>"),
        false => needed.clone(),
    };
    let all: Vec<String> = needed.iter().map(each).collect();
    all.join(if folder { ", and " } else { " and " })
}

fn contexts(error: &clap::Error, kind: ContextKind) -> Vec<String> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => vec![text.clone()],
        Some(ContextValue::Strings(list)) => list.clone(),
        _ => Vec::new(),
    }
}

fn context(error: &clap::Error, kind: ContextKind) -> String {
    contexts(error, kind).into_iter().next().unwrap_or_default()
}

/// As the mistakes of pipelines are told.
fn message(told: &str, typed: &str, note: &str) -> String {
    format!("error: {}", marked(told, typed, note))
}

/// What is wrong with the text `typed`, which is shown with a caret below it.
pub(super) fn marked(told: &str, typed: &str, note: &str) -> String {
    let carets = "^".repeat(typed.chars().count().max(1));
    let note = if note.is_empty() { String::new() } else { format!("\n   = {note}") };
    format!("{told}\n   | {typed}\n   | {carets}{note}")
}

/// "did you mean `--output` or `--outdir`? ", or nothing.
fn meant<'a>(words: impl Iterator<Item = &'a String>) -> String {
    let words: Vec<String> = words.map(|word| format!("`{word}`")).collect();
    match words.is_empty() {
        true => String::new(),
        false => format!("did you mean {}? ", words.join(" or ")),
    }
}

/// The options that a wrong one may mean: those that it is the beginning of, first what has a short
/// name, else the nearest.
fn like(command: &Command, option: &str) -> Vec<String> {
    let shown = |argument: &Arg| !argument.is_hide_set();
    let mut known: Vec<&Arg> = command.get_arguments().filter(|argument| shown(argument)).collect();
    known.sort_by_key(|argument| argument.get_short().is_none());
    let name = |argument: &Arg| Some(format!("--{}", argument.get_long()?));
    let names: Vec<String> = known.into_iter().filter_map(name).collect();
    let begun = names.iter().filter(|name| option.len() > 3 && name.starts_with(option));
    let begun: Vec<String> = begun.cloned().collect();
    match begun.is_empty() {
        true => nearest(option, &names).into_iter().cloned().collect(),
        false => begun,
    }
}

/// What helps where no output is named: the last argument may be meant for it.
fn output(typed: &[OsString], formats: &Formats) -> Option<String> {
    let last = typed.iter().skip(3).next_back()?.to_str()?;
    let path = std::path::Path::new(last);
    let is_output = !last.starts_with('-') && formats.of(path).is_some();
    let is_new = fs::symlink_metadata(path).is_err() && !last.contains(['*', '?', '[']);
    (is_output && is_new).then(|| format!("if `{last}` is the output, write `-o {last}`"))
}
