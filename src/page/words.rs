//! Figures as a reader of a page takes them in.

use serde_json::Value;

use crate::report::{Bytes, Grouped, Short};

/// A length in the scan's unit; of metres the short ones in millimetres.
pub(super) fn length(length: f64, unit: Option<&str>) -> String {
    match unit {
        Some("m") if length > 0.0 && length < 0.1 => format!("{} mm", Short(length * 1000.0)),
        Some(unit) => format!("{} {unit}", Short(length)),
        None => Short(length).to_string(),
    }
}

/// A length at an axis, which has one digit that means something.
pub(super) fn tick(length: f64, unit: Option<&str>) -> String {
    let (number, unit) = match unit {
        Some("m") if length < 0.1 - 1e-9 => (length * 1000.0, " mm".to_owned()),
        unit => (length, unit.map_or(String::new(), |unit| format!(" {unit}"))),
    };
    let fixed = format!("{number:.9}");
    format!("{}{unit}", fixed.trim_end_matches('0').trim_end_matches('.'))
}

/// A count with commas.
pub(super) fn count(count: u64) -> String {
    Grouped(count).to_string()
}

/// A part of all in percent; nothing where there is none.
pub(super) fn percent(part: u64, all: u64) -> String {
    match all {
        0 => String::new(),
        all => format!("{:.1} %", 100.0 * part as f64 / all as f64),
    }
}

/// A size.
pub(super) fn bytes(bytes: Option<u64>) -> String {
    bytes.map_or(String::new(), |bytes| Bytes(bytes).to_string())
}

/// The value of a setting.
pub(super) fn value(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(list) => {
            let all: Vec<String> = list.iter().map(self::value).collect();
            if all.is_empty() { "none".to_owned() } else { all.join(", ") }
        }
        other => other.to_string(),
    }
}

/// A name of a setting in words.
pub(super) fn plain(name: &str) -> String {
    name.replace('_', " ")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn short_lengths_in_metres_are_millimetres() {
        let told = [(0.0, Some("m")), (0.0123, Some("m")), (0.25, Some("m")), (0.01, Some("ft"))];
        let told = told.map(|(number, unit)| length(number, unit));
        assert_eq!(told, ["0 m", "12.3 mm", "0.250 m", "0.0100 ft"]);
        assert_eq!(length(0.01, None), "0.0100");
        let ticks = [(0.1, Some("m")), (0.001, Some("m")), (1e-4, None), (10.0, Some("ft"))];
        let ticks = ticks.map(|(number, unit)| tick(number, unit));
        assert_eq!(ticks, ["0.1 m", "1 mm", "0.0001", "10 ft"]);
    }

    #[test]
    fn settings_and_parts_are_told_without_quotes() {
        assert_eq!(value(&json!(["a", 2, true])), "a, 2, true");
        assert_eq!((value(&json!([])), value(&json!("10%"))), ("none".into(), "10%".into()));
        assert_eq!((percent(1, 8), percent(0, 0)), ("12.5 %".into(), String::new()));
    }
}
