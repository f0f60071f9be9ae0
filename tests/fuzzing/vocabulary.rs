//! The words of pipeline files, as the registry tells them: kinds, keys and values, learned from the
//! help that errors give.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use pointmill::{Graph, Registry};

/// What stands in pipeline files besides words of the registry.
const OTHERS: &[&str] = &[
    "[run]\n",
    "[[stage]]\n",
    "kind = \"read\"\n",
    "kind = \"write\"\n",
    "run",
    "stage",
    "kind",
    "name",
    "from",
    "true",
    "false",
    "nan",
    "-inf",
    "1979-05-27",
    "07:32:00",
    "[1, 2, 3]",
    "[0.01, 0.01, 0.01]",
    "{ a = 1 }",
    "[]",
    "\"\"",
    "'''",
    "\"\"\"",
    "\"2GiB\"",
    "\"512 kB\"",
    "\"6deg\"",
    "\"400deg\"",
    "\"-1deg\"",
    "0x10",
    "1_000",
    "1e400",
    "1.5",
    "-1",
    "[[[[[[[[",
    "a.b.c",
    "\"tiny.las\"",
    "\"tiny.laz\"",
    "\"tiny.ply\"",
    "\"broken.laz\"",
    "\"missing.las\"",
    "\"out.las\"",
    "\"out.laz\"",
    "\"out.ply\"",
    "\"out.xyz\"",
    "\"folder\"",
    "\"*.la?\"",
    "\"[a-\"",
    "\"**\"",
    "\\u00e9",
    "\u{feff}",
    "\u{1F600}",
    "é",
    "\r\n",
    "\t",
    "\0",
    "#",
    "=",
    ".",
    ",",
    "Intensity",
    "GpsTime",
    "NormalX",
];

/// Every word, in a fixed order.
pub fn words() -> &'static [&'static [u8]] {
    static WORDS: OnceLock<Vec<&'static [u8]>> = OnceLock::new();
    WORDS.get_or_init(|| {
        let mut words = learned();
        assert!(words.len() > 30, "errors tell only {words:?}");
        words.extend(OTHERS.iter().map(|word| (*word).to_owned()));
        words.into_iter().map(|word| &*word.into_bytes().leak()).collect()
    })
}

fn learned() -> BTreeSet<String> {
    let registry = Registry::builtin();
    let told = |text: String| match Graph::parse(&text, "words", &registry) {
        Ok(_) => Vec::new(),
        Err(error) => listed(&error.to_string()),
    };
    let mut all: BTreeSet<String> = registry.kinds().map(|(kind, _)| kind.to_owned()).collect();
    let tables: Vec<String> = all
        .iter()
        .map(|kind| format!("[[stage]]\nkind = \"{kind}\"\n"))
        .chain(["[run]\n".to_owned()])
        .collect();
    for table in tables {
        for key in told(format!("{table}qqq = 1\n")) {
            all.extend(told(format!("{table}{key} = \"qqq\"\n")));
            all.insert(key);
        }
    }
    all
}

/// The words behind "keys:" or "valid:" in a message.
fn listed(message: &str) -> Vec<String> {
    let lists = message.lines().filter_map(|line| {
        let at = ["keys: ", "valid: "].iter().find_map(|w| Some(line.find(w)? + w.len()))?;
        Some(line[at..].split(", "))
    });
    lists.flatten().map(|word| word.trim().to_owned()).collect()
}
