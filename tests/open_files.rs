//! A thousand inputs and their outputs while a process may hold but a few files open.

#![allow(clippy::unwrap_used, reason = "a test may panic and tell why")]

mod support;

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use crate::support::folders::{assert_equal_files, write_each};
use crate::support::las::{LAS, LAZ, write};
use pointmill::io::las::{fresh, layout};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

const FILES: i32 = 1_000;
/// What a process may hold; the tests' own threads and pipes are among it.
const OPEN: u64 = 40;

#[test]
fn a_thousand_inputs_have_their_outputs_with_forty_files_open() {
    let at = tempfile::tempdir().unwrap();
    let inputs: Vec<PathBuf> = (0..FILES)
        .map(|n| {
            let path =
                at.path().join(format!("tile {n:04}.{}", if n % 3 == 0 { "laz" } else { "las" }));
            let corner = [f64::from(n % 32) * 100.0, f64::from(n / 32) * 100.0, 0.0];
            let schema = Arc::new(layout(6, &[], [0.01; 3], corner));
            let mut records = vec![0u8; schema.stride * 20];
            for (record, i) in records.chunks_exact_mut(schema.stride).zip(0..) {
                record[..4].copy_from_slice(&(n + 500 * i).to_le_bytes());
                record[8..12].copy_from_slice(&i.to_le_bytes());
            }
            let options = if n % 3 == 0 { LAZ } else { LAS };
            write(&path, options, &schema, &fresh(&schema, Some("PROJCS[\"x\"]")), &records)
                .unwrap();
            let mut bytes = fs::read(&path).unwrap();
            bytes[8..12].copy_from_slice(&n.to_le_bytes());
            if n % 3 > 0 {
                // An extended record: those are compared while the files are opened.
                let end = bytes.len() as u64;
                let mut evlr = vec![0u8; 60 + 4];
                evlr[2..7].copy_from_slice(b"notes");
                evlr[20] = 4;
                evlr[60..].copy_from_slice(&(n / 7).to_le_bytes());
                bytes.extend(evlr);
                bytes[235..243].copy_from_slice(&end.to_le_bytes());
                bytes[243] = 1;
            }
            fs::write(&path, bytes).unwrap();
            path
        })
        .collect();
    let folder = at.path().join("out");
    fs::create_dir(&folder).unwrap();
    let before = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: Some(OPEN), ..before }).unwrap();
    let outputs = write_each(&inputs, &format!("folder = '{}'", folder.display()), |_, _| true);
    setrlimit(Resource::Nofile, before).unwrap();
    let outputs = outputs.unwrap();
    assert_eq!(outputs.len(), FILES as usize);
    for (input, output) in inputs.iter().zip(&outputs) {
        assert_equal_files(input, output);
    }
}
