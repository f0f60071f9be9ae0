//! Reads the doc comments of items, fields and variants from Rust source, formatted by rustfmt.

/// A public field: its name, its type as written, its documentation.
pub struct Field {
    pub name: String,
    pub kind: String,
    pub docs: String,
}

/// An enum as a pipeline file has it: its words with their documentation, and the default.
pub struct Enum {
    pub words: Vec<(String, String)>,
    pub default: Option<String>,
}

/// The documentation of a public `struct`, `enum` or `fn`, for people who read no Rust.
pub fn item_docs(text: &str, sort: &str, name: &str) -> String {
    let begins = |line: &str| {
        line.strip_prefix(&format!("pub {sort} {name}"))
            .is_some_and(|rest| rest.starts_with([' ', '(', '<', ';']))
    };
    let lines: Vec<&str> = text.lines().collect();
    let at = lines.iter().position(|line| begins(line));
    let at = at.unwrap_or_else(|| panic!("there is no {sort} {name}"));
    let docs = docs_above(&lines[..at]);
    assert!(!docs.is_empty(), "{sort} {name} has no documentation");
    docs
}

/// The documentation of a struct and its public fields, in order.
pub fn struct_of(text: &str, name: &str) -> (String, Vec<Field>) {
    let docs = item_docs(text, "struct", name);
    let mut fields = Vec::new();
    let lines = body(text, "struct", name).unwrap_or_default();
    for (at, line) in lines.iter().enumerate() {
        let Some(field) = line.strip_prefix("    pub ") else { continue };
        let (name, kind) = field.split_once(": ").unwrap_or_else(|| panic!("no field: {line}"));
        let docs = docs_above(&lines[..at]);
        assert!(!docs.is_empty(), "the field {name} has no documentation");
        let kind = kind.trim_end_matches(',').to_owned();
        fields.push(Field { name: name.to_owned(), kind, docs });
    }
    (docs, fields)
}

/// The words of an enum whose variants are written in kebab case, or as `serde` renames them; None
/// if there is no such enum.
pub fn enum_of(text: &str, name: &str) -> Option<Enum> {
    let lines = body(text, "enum", name)?;
    let (mut words, mut default) = (Vec::new(), None);
    for (at, line) in lines.iter().enumerate() {
        let Some(variant) = line.strip_prefix("    ").and_then(|v| v.strip_suffix(',')) else {
            continue;
        };
        if variant.is_empty() || !variant.chars().all(char::is_alphanumeric) {
            continue;
        }
        let above = lines[..at].iter().rev().map(|line| line.trim());
        let attributes: Vec<&str> = above.take_while(|line| line.starts_with("#[")).collect();
        let renamed = attributes.iter().find_map(|a| a.strip_prefix("#[serde(rename = \""));
        let renamed = renamed.and_then(|rest| rest.strip_suffix("\")]"));
        let word = renamed.map_or_else(|| kebab(variant), str::to_owned);
        if attributes.contains(&"#[default]") {
            default = Some(word.clone());
        }
        words.push((word, docs_above(&lines[..at])));
    }
    assert!(!words.is_empty(), "the enum {name} was not read");
    Some(Enum { words, default })
}

/// `TwoWords` as `two-words`.
fn kebab(variant: &str) -> String {
    let mut word = String::new();
    for letter in variant.chars() {
        if letter.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(letter.to_lowercase());
    }
    word
}

/// The lines between the braces of an item.
fn body<'a>(text: &'a str, sort: &str, name: &str) -> Option<Vec<&'a str>> {
    let opens = format!("pub {sort} {name} {{");
    let lines = text.lines().skip_while(|line| *line != opens).skip(1);
    let inside: Vec<&str> = lines.take_while(|line| *line != "}").collect();
    (!inside.is_empty()).then_some(inside)
}

/// The doc comment that ends `lines`, above attributes: up to its first example, links as their
/// text.
fn docs_above(lines: &[&str]) -> String {
    let lines = lines.iter().rev().map(|line| line.trim());
    let comment: Vec<&str> = lines
        .skip_while(|line| line.starts_with("#[") || line.ends_with(")]"))
        .map_while(|line| line.strip_prefix("///"))
        .collect();
    let text: Vec<&str> =
        comment.iter().rev().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    // An example in Rust ends what they are told; one of a pipeline belongs to it.
    let mut in_pipeline = false;
    let is_told = |line: &&str| match (line.strip_prefix("```"), in_pipeline) {
        (None, _) => true,
        (Some(_), true) => {
            in_pipeline = false;
            true
        }
        (Some(language), false) => {
            in_pipeline = language == "toml";
            in_pipeline
        }
    };
    let text: Vec<&str> = text.into_iter().take_while(is_told).collect();
    without_links(text.join("\n").trim())
}

/// [`a`](b) and [`a`] become `a`.
fn without_links(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("[`") {
        out += before;
        let Some((code, behind)) = after.split_once("`]") else { break };
        out += &format!("`{code}`");
        rest = match behind.strip_prefix('(').and_then(|link| link.split_once(')')) {
            Some((_, behind)) => behind,
            None => behind,
        };
    }
    out + rest
}

#[test]
fn comments_and_fields_are_read() {
    let text = "/// A stage, see [`X::y`](x) and [`z`].\n///\n/// More.\n#[derive(Debug)]\npub struct S {\n    \
                /// A key\n    /// of two lines.\n    #[serde(default)]\n    pub key: Option<f64>,\n    hidden: u8,\n}\n\n\
                /// Words.\npub enum E {\n    /// One.\n    #[default]\n    One,\n    /// Two.\n    TwoWords,\n    \
                /// Three.\n    #[serde(rename = \"3\")]\n    Three,\n}\n";
    let (docs, fields) = struct_of(text, "S");
    assert_eq!(docs, "A stage, see `X::y` and `z`.\n\nMore.");
    assert_eq!(fields.len(), 1);
    assert_eq!((&*fields[0].name, &*fields[0].kind), ("key", "Option<f64>"));
    assert_eq!(fields[0].docs, "A key\nof two lines.");
    let words = enum_of(text, "E").unwrap();
    assert_eq!(words.default.as_deref(), Some("one"));
    let expected = [("one", "One."), ("two-words", "Two."), ("3", "Three.")];
    assert_eq!(words.words, expected.map(|(word, docs)| (word.to_owned(), docs.to_owned())));
    assert!(enum_of(text, "F").is_none());
}
