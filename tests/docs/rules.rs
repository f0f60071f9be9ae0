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
counts of point formats 6 to 10 must be 0, as LAS 1.4 R15 says; the order of GPS times inside of a
COPC node is no rule of COPC 1.0 and is not looked at. LAS 1.0 to 1.5 are checked.

Points are read once, by as many threads as `--threads` says, in a memory that `--memory` bounds;
what is told is the same for any number of them.
";

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
    keep("docs/validate.md", &page);
}
