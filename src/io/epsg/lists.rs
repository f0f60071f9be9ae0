//! Which coordinate reference systems are on a datum.

use super::definitions::{BAR, TABLE};

/// The geographic and projected systems on the geodetic datum `datum`, in the order of their codes.
pub fn systems_on(datum: u32) -> Vec<u32> {
    let mut systems = codes("geographic", &|of| of == datum);
    let projected = codes("projected", &|base| systems.contains(&base));
    systems.extend(projected);
    systems.sort_unstable();
    systems
}

/// The systems of heights on the datum `datum`.
pub fn heights_on(datum: u32) -> Vec<u32> {
    codes("vertical", &|of| of == datum)
}

/// The codes of the lines of a kind whose second field, behind a name, is a code that is wanted.
fn codes(kind: &str, is_wanted: &dyn Fn(u32) -> bool) -> Vec<u32> {
    let lines = TABLE.lines().filter_map(|line| line.strip_prefix(kind)?.strip_prefix(' '));
    let of_line = |line: &str| {
        let mut fields = line.split(BAR);
        let (code, of) = (fields.next()?, fields.nth(1)?);
        is_wanted(of.parse().ok()?).then(|| code.parse().ok())?
    };
    lines.filter_map(of_line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_listed_by_their_datum() {
        let etrs = systems_on(6258);
        assert!(etrs.contains(&4258) && etrs.contains(&25832) && !etrs.contains(&32632));
        assert!(etrs.is_sorted() && systems_on(1).is_empty());
        assert!(heights_on(5103).contains(&5703) && heights_on(5103).contains(&6360));
    }
}
