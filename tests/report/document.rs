//! The report of a run.

use crate::support::case::execute;

use pointmill::{Overrides, Quiet};

#[test]
fn a_report_says_how_many_records_each_input_had() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = |text: &str| execute(text, &Overrides::default(), &Quiet).unwrap().report.run;
    for (name, points) in [("a.las", 1000), ("b.las", 2500)] {
        let synth = format!("[[stage]]\nkind = 'synth'\nscene = 'plane'\npoints = {points}\n");
        run(&format!("{synth}[[stage]]\nkind = 'write'\npath = '{}'\n", at(name)));
    }
    let read = format!("[[stage]]\nkind = 'read'\npath = ['{}', '{}']\n", at("b.las"), at("a.las"));
    for order in ["input", "canonical"] {
        let write =
            format!("[[stage]]\nkind = 'write'\npath = '{}'\norder = '{order}'\n", at("o.laz"));
        let figures = run(&(read.clone() + &write));
        let inputs: Vec<u64> = figures.inputs.iter().map(|input| input.points).collect();
        assert_eq!((inputs, figures.outputs[0].points), (vec![2500, 1000], 3500), "{order}");
    }
}
