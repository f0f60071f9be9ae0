//! Pipelines in one line, as they are typed: stages between ` ! `, each a kind, the value of its
//! main key, and `key=value`.

use super::mistake::Mistake;
use super::node;
use super::node::{KeyEntry, Node, NodeValue};
use super::place::{PlacedWord, TextPlace};
use super::references::is_name;
use super::registry::Registry;

/// What stands between stages, as a word of its own.
const BETWEEN: &str = "!";

/// True for a text that has a `!` between spaces: a pipeline, and no name of a file.
pub(super) fn is_line(text: &str) -> bool {
    text.split_whitespace().any(|word| word == BETWEEN)
}

/// Reads text 0 as the table of its stages, or tells every word that cannot be.
pub(super) fn parse(text: &str, registry: &Registry) -> Result<Vec<KeyEntry>, Vec<Mistake>> {
    let mut mistakes = Vec::new();
    let words = words(text).map_err(|wrong| vec![wrong])?;
    let whole = TextPlace::new(0, 0..text.len());
    let mut stages = Vec::new();
    // Where a stage that has no words would stand: before the next `!`, or behind the last.
    let end = (String::new(), TextPlace::new(0, text.trim_end().len()..text.trim_end().len()));
    let ends = words.iter().filter(|(word, _)| word == BETWEEN).chain([&end]);
    for (words, (_, end)) in words.split(|(word, _)| word == BETWEEN).zip(ends) {
        match words.split_first() {
            Some((kind, words)) => stages.push(stage(kind, words, registry, &mut mistakes)),
            None => {
                let told = "a stage is missing here";
                let help = format!("stages stand between ` {BETWEEN} `, such as `read in.laz`");
                mistakes.push(Mistake::new(end.clone(), told).note(help));
            }
        }
    }
    let node = Node { place: whole.clone(), value: NodeValue::List(stages) };
    match mistakes.is_empty() {
        true => Ok(vec![KeyEntry { key: "stage".to_owned(), at: whole, node }]),
        false => Err(mistakes),
    }
}

/// The table of a stage from its words.
fn stage(
    kind: &PlacedWord,
    words: &[PlacedWord],
    registry: &Registry,
    mistakes: &mut Vec<Mistake>,
) -> Node {
    let (name, at) = kind;
    let mut entries = vec![entry("kind", at, text(kind))];
    for (n, word) in words.iter().enumerate() {
        let (key, value) = match (key_value(word), registry.main(name)) {
            (Some((key, value)), _) => (key, value),
            (None, Some(main)) if n == 0 => ((main.to_owned(), word.1.clone()), word.clone()),
            // What its main key is, is not known of a kind that there is not.
            (None, None) if n == 0 && !registry.has(name) => continue,
            (None, main) => {
                mistakes.push(no_key(word, name, main));
                break; // the words behind it are of the same value, most likely
            }
        };
        let (key, at) = key;
        if entries.iter().any(|entry| entry.key == key) {
            let told = format!("`{key}` of `{name}` is given twice");
            mistakes.push(Mistake::new(at, told));
            continue;
        }
        match read_value(&value) {
            Ok(node) => entries.push(entry(&key, &at, node)),
            Err(wrong) => mistakes.extend(wrong),
        }
    }
    Node { place: at.clone(), value: NodeValue::Table(entries) }
}

fn entry(key: &str, at: &TextPlace, node: Node) -> KeyEntry {
    KeyEntry { key: key.to_owned(), at: at.clone(), node }
}

fn text((text, place): &PlacedWord) -> Node {
    Node { place: place.clone(), value: NodeValue::Text(text.clone()) }
}

/// The two sides of `key=value`; None of any other word.
fn key_value((word, place): &PlacedWord) -> Option<(PlacedWord, PlacedWord)> {
    let (key, value) = word.split_once('=').filter(|(key, _)| is_name(key))?;
    let (start, middle) = (place.start, place.start + key.len());
    let at = |span| TextPlace::new(place.source, span);
    let value = (value.to_owned(), at(middle + 1..place.end));
    Some(((key.to_owned(), at(start..middle)), value))
}

/// A value as `--set` takes it; the items of a list in brackets need no quotes either.
fn read_value((text, place): &PlacedWord) -> Result<Node, Vec<Mistake>> {
    match node::parse_list(text, place) {
        Some(list) => Ok(list),
        None => node::parse_value(text, place.source, place.start),
    }
}

/// What a word is told that is no `key=value`.
fn no_key((word, at): &PlacedWord, kind: &str, main: Option<&str>) -> Mistake {
    let told = format!("`{word}` is no KEY=VALUE");
    let help = match main {
        Some(main) => format!(
            "the one word that `{kind}` takes without a key is its `{main}`, right behind it; a \
             value with spaces is written in quotes"
        ),
        None => format!("`{kind}` takes KEY=VALUE alone; a value with spaces is written in quotes"),
    };
    Mistake::new(at.clone(), told).note(help)
}

/// The words of a text. Space within quotes and brackets is a part of a word; both are taken for
/// such at the beginning of a word or a value alone, so that `it's.laz` and `tile[12].laz` are
/// words.
fn words(text: &str) -> Result<Vec<PlacedWord>, Mistake> {
    let mut words = Vec::new();
    let mut rest = text.char_indices().peekable();
    while let Some(&(start, first)) = rest.peek() {
        if first.is_whitespace() {
            rest.next();
            continue;
        }
        // What is open: a quote, or brackets.
        let (mut quote, mut open): (Option<(char, usize)>, Vec<usize>) = (None, Vec::new());
        let (mut end, mut before) = (start, ' ');
        while let Some(&(at, c)) = rest.peek() {
            let begins = before == ' ' || before == '=' || before == ',' || before == '[';
            match quote {
                Some((quote, _)) if c == '\\' && quote == '"' => drop(rest.next()),
                Some((closing, _)) if c == closing => quote = None,
                Some(_) => {}
                None if c.is_whitespace() && open.is_empty() => break,
                None if matches!(c, '"' | '\'') && begins => quote = Some((c, at)),
                None if c == '[' && begins => open.push(at),
                None if c == ']' => drop(open.pop()),
                None => {}
            }
            before = if c.is_whitespace() { ' ' } else { c };
            end = at + c.len_utf8();
            rest.next();
        }
        if let Some(at) = quote.map(|(_, at)| at).or(open.pop()) {
            let opening = &text[at..=at];
            let told = format!("`{opening}` is not closed");
            return Err(Mistake::new(TextPlace::new(0, at..at + 1), told));
        }
        let end = end.min(text.len());
        words.push((text[start..end].to_owned(), TextPlace::new(0, start..end)));
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_end_at_spaces_outside_of_quotes_and_brackets() {
        let of = |text| -> Vec<String> {
            words(text).unwrap().into_iter().map(|(word, _)| word).collect()
        };
        assert_eq!(of(""), [""; 0]);
        assert_eq!(of(" read  in.laz\t!\nnormals "), ["read", "in.laz", "!", "normals"]);
        assert_eq!(of("a=\"b ! c\" d='e f'"), ["a=\"b ! c\"", "d='e f'"]);
        assert_eq!(of("a=[b, \"c d\"] e"), ["a=[b, \"c d\"]", "e"]);
        assert_eq!(
            of("it's.laz tile[12].laz [ab]*.laz"),
            ["it's.laz", "tile[12].laz", "[ab]*.laz"]
        );
        assert_eq!(of(r#"a="b \" c" ö"#), [r#"a="b \" c""#, "ö"]);
        for text in ["a=\"b", "read 'x", "a=[b, c", "a=\"b\\", "a=[\"b]"] {
            assert!(words(text).is_err(), "{text}");
        }
    }
}
