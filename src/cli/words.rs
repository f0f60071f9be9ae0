//! The words of what was typed: messages of the library, which name settings as a pipeline file has
//! them, are put into the flags that the user of the command can type.

use super::arguments::Command;
use super::flags::{
    common_flags, compare_flags, convert_flags, cut_flags, reduce_flags, synth_flags, verify_flags,
    walk_flags,
};
use super::form::united;
use crate::Error;
use crate::language::Registry;

/// What the user of one command can type for the settings that messages name.
pub(super) struct Words {
    flags: Vec<(&'static str, &'static str)>,
    /// True if the command takes a pipeline file, which may have any setting.
    has_file: bool,
    registry: Registry,
}

impl Words {
    /// The words of `command`, whose pipelines may name what is in `registry`.
    pub fn of(command: &Command, registry: &Registry) -> Words {
        let flags = match command {
            Command::Run(_) | Command::Plan(_) | Command::Check(_) => Vec::new(),
            Command::Reduce(reduce) => reduce_flags(reduce),
            Command::Verify(verify) => verify_flags(verify),
            Command::Compare(compare) => compare_flags(compare),
            Command::Cut(cut) => cut_flags(cut),
            Command::Convert(convert) => convert_flags(convert, None, None),
            Command::Synth(synth) => synth_flags(synth),
            Command::Info(_) | Command::Validate(_) => walk_flags(),
            Command::Picture(_) | Command::Stages(_) => Vec::new(),
            Command::Reproduce(_) => Vec::new(),
            Command::Graph(_) | Command::Explain(_) => Vec::new(),
            Command::New(_) | Command::Schema => Vec::new(),
            Command::Completions(_) | Command::Man(_) => Vec::new(),
        };
        let written = match command {
            Command::Reduce(reduce) => united(&reduce.written),
            Command::Convert(convert) => united(&convert.written),
            _ => Vec::new(),
        };
        let flags = flags.into_iter().chain(written);
        let common = command.common().map(common_flags).unwrap_or_default();
        let flags = flags.chain(common).map(|flag| (flag.address, flag.name));
        Words {
            flags: flags.collect(),
            has_file: matches!(
                command,
                Command::Run(_)
                    | Command::Plan(_)
                    | Command::Check(_)
                    | Command::Graph(_)
                    | Command::Explain(_)
            ),
            registry: registry.clone(),
        }
    }

    /// `message` with every setting that it names (`` `write.drop = ["GpsTime"]` ``) put into what
    /// can be typed (`` `--drop GpsTime` ``).
    pub fn told(&self, message: &str) -> String {
        let mut out = String::with_capacity(message.len());
        let mut rest = message;
        while let Some((before, inside, behind)) = quoted(rest) {
            out += before;
            match self.typed(inside) {
                Some(typed) => {
                    out += &typed;
                    rest = behind;
                }
                // What ends this quotation may begin another.
                None => {
                    out.push('`');
                    rest = &rest[before.len() + 1..];
                }
            }
        }
        out + rest
    }

    /// True for the address of a setting, as `--set` takes it.
    fn is_setting(&self, address: &str) -> bool {
        let Some((table, key)) = address.split_once('.') else { return false };
        let described = match table {
            "run" => Some(self.registry.describe_run()),
            "accept" => Some(self.registry.describe_accept()),
            kind => self.registry.describe(kind),
        };
        described.is_some_and(|table| table.all_keys().any(|known| known.name == key))
    }

    /// What can be typed for a setting, with its value or without; None if `text` is no setting.
    fn typed(&self, text: &str) -> Option<String> {
        let (address, value) = match text.split_once(" = ") {
            Some((address, value)) => (address, Some(value)),
            None => (text, None),
        };
        if let (true, Some(name), Some(value)) =
            (self.has_file, address.strip_prefix("params."), value)
        {
            return Some(format!("`--param {name}={}`", argument(value)));
        }
        let flag = self.flags.iter().find(|(known, _)| *known == address);
        match (flag, value) {
            (None, _) if !self.is_setting(address) => None,
            (None, _) if self.has_file => Some(format!("`{text}`")),
            (None, _) => Some(format!("`{text}` in a pipeline file (`pointmill run FILE`)")),
            (Some((_, name)), Some(value)) if !matches!(value, "true" | "false") => {
                Some(format!("`{name} {}`", argument(value)))
            }
            (Some((_, name)), _) => Some(format!("`{name}`")),
        }
    }
}

/// An error in the words of a command.
pub(super) struct Told<'a> {
    /// Its kind, file and byte.
    pub error: &'a Error,
    /// Place and message.
    pub message: String,
    /// The causes beneath, from the first to the deepest.
    pub causes: Vec<String>,
    /// What the user can do.
    pub help: Option<String>,
}

impl<'a> Told<'a> {
    /// `error` in these words.
    pub fn of(error: &'a Error, words: &Words) -> Self {
        let first = std::error::Error::source(error);
        let causes = std::iter::successors(first, |cause| cause.source());
        Told {
            error,
            message: words.told(&error.to_string()),
            causes: causes.map(|cause| words.told(&cause.to_string())).collect(),
            help: error.remedy().map(|help| words.told(help)),
        }
    }
}

/// The text before the first quotation in backticks, what it quotes, and the text behind it.
fn quoted(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('`')?;
    let (inside, behind) = rest.split_once('`')?;
    Some((before, inside, behind))
}

/// A TOML value as an argument of a shell's command: texts without their quotes, lists with commas.
fn argument(value: &str) -> String {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let plain = match toml::from_str::<toml::Table>(&format!("value = {value}")) {
        Ok(table) => match table.get("value") {
            Some(toml::Value::Array(list)) => list.iter().map(text).collect::<Vec<_>>().join(","),
            Some(toml::Value::String(text)) => text.clone(),
            // As it is written: TOML shows 1e308 in 309 digits.
            _ => value.to_owned(),
        },
        Err(_) => value.to_owned(), // a placeholder, such as [x, y, z]
    };
    let is_safe = |c: char| c.is_alphanumeric() || "-_.,/:=+%@~".contains(c);
    match !plain.is_empty() && plain.chars().all(is_safe) {
        true => plain,
        false => format!("'{}'", plain.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::arguments::Arguments;
    use super::*;

    fn words(command: &[&str]) -> Words {
        let typed = [&["pointmill"], command].concat();
        Words::of(&Arguments::try_parse_from(typed).unwrap().command, &Registry::builtin())
    }

    #[test]
    fn a_setting_becomes_the_flag_of_the_command() {
        let reduce = words(&["reduce", "a.laz", "-o", "b.laz"]);
        for (message, told) in [
            ("give `run.memory = \"270MiB\"` or more", "give `--memory 270MiB` or more"),
            ("`write.drop = [\"GpsTime\", \"a b\"]` is", "`--drop 'GpsTime,a b'` is"),
            ("`write.offset = [1.0, -2.0, 0.0]`", "`--offset 1.0,-2.0,0.0`"),
            ("fewer `run.threads`", "fewer `--threads`"),
            ("`read.path` or `write.path`", "`IN` or `-o`"),
            (
                "or give `write.dimensions`",
                "or give `write.dimensions` in a pipeline file (`pointmill run FILE`)",
            ),
            ("`cells.classes = [2]`", "`--classes 2`"),
            ("`cells.keep = true`", "`--keep`"),
            ("`cells.side = 1e308`", "`--side 1e308`"),
            ("`run.nowhere = 1` and `x` and `a.laz`", "`run.nowhere = 1` and `x` and `a.laz`"),
            ("a lone ` and `run.memory`", "a lone ` and `--memory`"),
        ] {
            assert_eq!(reduce.told(message), told);
        }
    }

    #[test]
    fn a_pipeline_file_keeps_its_keys_and_takes_the_common_flags() {
        let run = words(&["run", "p.toml"]);
        let message = "`run.scratch`, `run.nonfinite = \"drop\"`, `write.drop = [\"A\"]`";
        let told = "`--scratch`, `run.nonfinite = \"drop\"`, `write.drop = [\"A\"]`";
        assert_eq!(run.told(message), told);
        let message = "give `params.keep = VALUE`: `params.keep` has no default";
        let told = "give `--param keep=VALUE`: `params.keep` has no default";
        assert_eq!(run.told(message), told);
    }

    #[test]
    fn every_address_of_every_flag_is_a_setting() {
        for command in [
            &["reduce", "a.laz", "-o", "b.laz", "--outliers"][..],
            &["convert", "a.laz", "-o", "b.laz"],
            &["synth", "part", "-n", "1", "-o", "b.laz"],
            &["run", "p.toml"],
        ] {
            let words = words(command);
            assert!(words.flags.len() >= 4, "{command:?}");
            for (address, flag) in &words.flags {
                assert!(words.is_setting(address), "{flag} stands for {address}");
            }
        }
    }
}
