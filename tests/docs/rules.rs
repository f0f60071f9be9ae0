//! docs/validate.md: the rules that `validate` holds files to, as the formats themselves have them.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use pointmill::Registry;
use pointmill::stage::{FormatName, Rule};

use super::{SAYS_SO, keep};

const BEGIN: &str = "\
`pointmill validate FILE...` holds files to the rules of their formats: first what header and
records say, then every point. Files, patterns and folders are given as to `info`. Each rule that
does not hold is told with the clause of the specification, the first three places with their byte
and what is there, how many more there are, and what should be there. The exit code is 1 if a file
has a fault; the others are looked at all the same. A file that cannot be opened or read is a fault
in the words of the error. `--json` is [for programs](formats.md#validate), and `--quiet` leaves the
exit code alone.

A *fault* is what the specification forbids, or what makes a file unreadable. A *warning* is what is
allowed or common and trips programs up. A *note* is worth knowing. The faults are those of
[lasvalidate](https://github.com/LASvalidator/lasvalidate) and
[copc-validator](https://github.com/hobuinc/copc-validator), with these differences: a date that is
not set, a file without points, and point formats of waveforms without any are warnings here; legacy
counts of point formats 6 to 10 must be 0, as LAS 1.4 R15 says; that there is no coordinate reference
system, that values are the same in all points, and the order of GPS times inside of a COPC node,
which COPC 1.0 does not rule, are notes. [The rules of both](#the-rules-of-others) are below, beside
ours. LAS 1.0 to 1.5 are checked.

Points are read once, by as many threads as `--threads` says, in a memory that `--memory` bounds;
what is told is the same for any number of them.
";

/// What lasvalidate (its `lascheck.cpp`) checks, and our rules.
const LASVALIDATE: [(&str, &[&str]); 27] = [
    ("file signature", &["las-readable"]),
    (
        "global encoding",
        &["global-encoding", "wkt-bit", "gps-time-bit", "waveform-bits", "no-waveforms"],
    ),
    ("version major, version minor", &["version"]),
    ("system identifier, generating software", &["identifier", "identifier-padding"]),
    ("file creation day, file creation year", &["creation-date", "no-creation-date"]),
    ("header size", &["header-size"]),
    ("offset to point data", &["points-start", "vlrs"]),
    ("point data format", &["point-format"]),
    ("point data record length", &["record-length"]),
    ("zero points in file", &["no-points"]),
    ("legacy number of point records", &["legacy-count"]),
    ("legacy number of point by return", &["legacy-returns"]),
    ("number of point records", &["point-count"]),
    ("number of point by return", &["returns"]),
    ("x, y, z scale factor", &["scale", "odd-scale"]),
    ("x, y, z offset", &["offset-steps"]),
    ("start of waveform data packet record", &["waveform-start"]),
    ("coordinate values (resolution fluff)", &["coarse-coordinates"]),
    ("bounding box; min, max x, y, z", &["box"]),
    ("return number, number of returns: 0", &["return-zero"]),
    ("return number, number of returns: 6 and 7 before LAS 1.4", &["return-above"]),
    ("return number above number of returns", &["return-beyond"]),
    ("intensity, scan angle, GPS time, RGB: one value", &["same-values"]),
    ("point source ID", &["point-source-id"]),
    ("CRS: none, or of the wrong kind", &["no-crs", "crs-kind"]),
    ("CRS: what it says", &["wkt-text", "wkt-version", "geotiff-keys"]),
    ("wave packet descriptor", &["waveform-descriptor"]),
];

/// What copc-validator (its README) checks, and our rules.
const COPC_VALIDATOR: [(&str, &[&str]); 20] = [
    ("minorVersion, headerLength", &["copc-version"]),
    ("pointDataRecordFormat", &["copc-point-format"]),
    ("pointCountByReturn", &["returns"]),
    ("legacyPointCount", &["legacy-count"]),
    ("legacyPointCountByReturn", &["legacy-returns"]),
    ("vlrCount", &["vlrs"]),
    ("evlrCount", &["evlrs"]),
    ("copc-info", &["copc-info", "copc-info-reserved"]),
    ("copc-hierarchy", &["copc-hierarchy", "copc-pages"]),
    ("laszip-encoded", &["compressed"]),
    ("wkt", &["wkt-text", "no-crs"]),
    ("bounds within cube", &["copc-cube-holds"]),
    ("rgb", &["same-values"]),
    ("rgbi", &["colors"]),
    ("xyz", &["box", "copc-node-box"]),
    ("gpsTime", &["copc-gps-times"]),
    ("sortedGpsTime", &["copc-time-order"]),
    ("returnNumber", &["return-beyond"]),
    ("nodesReachable", &["copc-key", "copc-node"]),
    ("zeroPoint", &[]),
];

/// The rules of another program beside ours, each of which is in `known`.
fn others(page: &mut String, program: &str, theirs: &[(&str, &[&str])], known: &[&Rule]) {
    let _ = write!(page, "\n| {program} | ours |\n|---|---|\n");
    for (check, ours) in theirs {
        let names = ours.iter().map(|name| {
            assert!(known.iter().any(|rule| rule.name == *name), "{name} is no rule");
            format!("`{name}`")
        });
        let names = names.collect::<Vec<_>>().join(", ");
        let none = "none: COPC 1.0 has nodes without points";
        let _ = writeln!(page, "| {check} | {} |", if names.is_empty() { none } else { &names });
    }
}

fn table(page: &mut String, title: &str, rules: &[&Rule]) {
    let _ =
        write!(page, "\n## {title}\n\n| rule | | clause | what should be |\n|---|---|---|---|\n");
    for Rule { name, severity, clause, should } in rules {
        let _ = writeln!(page, "| `{name}` | {} | {clause} | {should} |", severity.name());
    }
}

#[test]
fn the_rules_of_formats_have_a_page() {
    let registry = Registry::builtin();
    let rules = |name: &str| {
        let format = registry.formats().named(&FormatName(name.to_owned())).unwrap();
        format.rules()
    };
    let (las, copc, e57, ply) = (rules("las"), rules("copc"), rules("e57"), rules("ply"));
    let names: Vec<&str> = copc.iter().chain(&e57).map(|rule| rule.name).collect();
    assert!(names.len() > 70 && names.len() == names.iter().collect::<BTreeSet<_>>().len());
    let mut page = format!("# validate\n\n<!-- {SAYS_SO} -->\n\n{BEGIN}");
    table(&mut page, "LAS and LAZ", &las);
    table(&mut page, "COPC, besides", &copc[las.len()..]);
    table(&mut page, "E57, besides the next", &e57[..e57.len() - ply.len()]);
    table(&mut page, "Every other format", &ply);
    page += "\n## The rules of others\n";
    let all: Vec<&Rule> = copc.clone();
    others(&mut page, "lasvalidate", &LASVALIDATE, &all);
    others(&mut page, "copc-validator", &COPC_VALIDATOR, &all);
    keep("docs/validate.md", &page);
}
