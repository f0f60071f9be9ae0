//! One output for each input: its own header, records, offset and name, from inputs that are read as
//! one scan.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::folders::{assert_equal_files, convert_one, ends, named, write_each};
use crate::support::las::{LAS, LAZ, write};
use crate::support::random::Random;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::Scalar;
use pointmill::{Graph, Overrides, Registry};

/// Records of random bytes whose stored coordinates leave room for a shift.
fn records(stride: usize, points: usize, random: &mut Random) -> Vec<u8> {
    let mut records = random.bytes(points * stride);
    for record in records.chunks_exact_mut(stride) {
        for axis in 0..3 {
            let stored = random.below(1 << 24) as i32 - (1 << 23);
            record[4 * axis..][..4].copy_from_slice(&stored.to_le_bytes());
        }
    }
    records
}

/// Puts a record of `user` into a LAS file that has not been compressed and has no extended ones.
fn insert_vlr(path: &Path, user: &str, payload: &[u8]) {
    let mut bytes = fs::read(path).unwrap();
    let mut vlr = vec![0u8; 54];
    vlr[2..2 + user.len()].copy_from_slice(user.as_bytes());
    vlr[18..20].copy_from_slice(&77u16.to_le_bytes());
    vlr[20..22].copy_from_slice(&(payload.len() as u16).to_le_bytes());
    vlr.extend_from_slice(payload);
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (start, count) = (word(96) + vlr.len() as u32, word(100) + 1);
    bytes[96..100].copy_from_slice(&start.to_le_bytes());
    bytes[100..104].copy_from_slice(&count.to_le_bytes());
    let header = usize::from(u16::from_le_bytes([bytes[94], bytes[95]]));
    bytes.splice(header..header, vlr);
    fs::write(path, bytes).unwrap();
}

/// Puts an extended record at the end of a LAS 1.4 file.
fn append_evlr(path: &Path, user: &str, payload: &[u8]) {
    let mut bytes = fs::read(path).unwrap();
    let at = bytes.len() as u64;
    let mut evlr = vec![0u8; 60];
    evlr[2..2 + user.len()].copy_from_slice(user.as_bytes());
    evlr[20..28].copy_from_slice(&(payload.len() as u64).to_le_bytes());
    bytes.extend(evlr);
    bytes.extend_from_slice(payload);
    bytes[235..243].copy_from_slice(&at.to_le_bytes());
    bytes[243..247].copy_from_slice(&1u32.to_le_bytes());
    fs::write(path, bytes).unwrap();
}

/// A file of `points`, with header fields and records of its own by `seed`.
fn las(path: &Path, offset: [f64; 3], points: usize, seed: u64) {
    let mut random = Random(seed);
    let extra = [("Height".to_owned(), Scalar::F32)];
    let schema = Arc::new(layout(7, &extra, [0.01, 0.01, 0.001], offset));
    let metadata = fresh(&schema, Some("PROJCS[\"somewhere\"]"));
    let records = records(schema.stride, points, &mut random);
    let plain = path.with_extension("plain");
    write(&plain, LAS, &schema, &metadata, &records).unwrap();
    let mut bytes = fs::read(&plain).unwrap();
    bytes[4..6].copy_from_slice(&(seed as u16).to_le_bytes());
    bytes[8..24].copy_from_slice(&random.bytes(16));
    bytes[26..30].copy_from_slice(format!("S{seed:03}").as_bytes());
    bytes[58..62].copy_from_slice(format!("W{seed:03}").as_bytes());
    bytes[90..92].copy_from_slice(&(seed as u16 % 365 + 1).to_le_bytes());
    bytes[92..94].copy_from_slice(&(2000 + seed as u16).to_le_bytes());
    fs::write(&plain, bytes).unwrap();
    insert_vlr(&plain, "LAStiling", &random.bytes(28));
    insert_vlr(&plain, "surveyor", format!("flown on day {seed}").as_bytes());
    append_evlr(&plain, "notes", &random.bytes(1_000));
    let source = open(std::slice::from_ref(&plain)).unwrap();
    let compressed = path.extension().unwrap().eq_ignore_ascii_case("laz");
    let options = if compressed { LAZ } else { LAS };
    write(path, options, source.schema(), source.metadata(), &records).unwrap();
    fs::remove_file(plain).unwrap();
}

/// Three files whose offsets lie whole steps apart, two of them compressed.
fn three(folder: &Path) -> Vec<PathBuf> {
    let of = |name: &str, x: f64, y: f64, points, seed| {
        let path = folder.join(name);
        las(&path, [x, y, 100.0], points, seed);
        path
    };
    vec![
        of("north.las", 431_000.37, 4_512_000.0, 12_000, 1),
        of("south west.laz", 430_000.0, 4_511_000.25, 50_345, 2),
        of("östlich.LAZ", 432_000.01, 4_511_500.99, 7, 3),
    ]
}

fn keys(folder: &Path, more: &str) -> String {
    format!("folder = '{}'\n{more}", folder.display())
}

#[test]
fn outputs_of_all_records_are_the_inputs_byte_for_byte() {
    let at = tempfile::tempdir().unwrap();
    let inputs = three(at.path());
    let folder = at.path().join("out");
    fs::create_dir(&folder).unwrap();
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let inputs = order.map(|i| inputs[i].clone());
        let outputs = write_each(&inputs, &keys(&folder, ""), |_, _| true).unwrap();
        for (input, output) in inputs.iter().zip(&outputs) {
            assert_eq!(input.file_name(), output.file_name());
            assert_equal_files(input, output);
        }
    }
}

#[test]
fn outputs_of_some_records_hold_them_byte_for_byte_under_their_own_header() {
    let at = tempfile::tempdir().unwrap();
    let inputs = three(at.path());
    let folder = at.path().join("out");
    fs::create_dir(&folder).unwrap();
    let keep = |input: usize, i: u64| input != 2 && i % 3 == 1;
    let outputs = write_each(&inputs, &keys(&folder, ""), keep).unwrap();
    for (n, (input, output)) in inputs.iter().zip(&outputs).enumerate() {
        let (before, all) = crate::support::las::read_files(std::slice::from_ref(input)).unwrap();
        let (after, some) = crate::support::las::read_files(std::slice::from_ref(output)).unwrap();
        assert_eq!(before.schema(), after.schema());
        let records = all.chunks_exact(before.schema().stride).zip(0u64..);
        let kept: Vec<u8> =
            records.filter(|(_, i)| keep(n, *i)).flat_map(|(r, _)| r.to_vec()).collect();
        assert!(kept == some, "records of {}", output.display());
        assert_eq!(kept.is_empty(), n == 2, "an input of which nothing is kept has its file");
        // All but counts, places and the box is the input's.
        let (one, two) = (fs::read(input).unwrap(), fs::read(output).unwrap());
        for (from, to) in [(0, 96), (100, 107), (131, 179)] {
            assert_eq!(one[from..to], two[from..to], "header of {}", output.display());
        }
        let holds =
            |bytes: &[u8], text: &str| bytes.windows(text.len()).any(|w| w == text.as_bytes());
        let note = format!("flown on day {}", n + 1);
        let other = format!("flown on day {}", (n + 1) % 3 + 1);
        assert!(holds(&two, &note) && !holds(&two, &other), "records of {}", output.display());
    }
}

#[test]
fn a_conversion_together_gives_the_files_of_conversions_one_by_one() {
    let at = tempfile::tempdir().unwrap();
    let inputs = three(at.path());
    for (extension, more) in [
        ("ply", "format = 'ply'\nencoding = 'ascii'"),
        ("ply", "format = 'ply'"),
        ("laz", "format = 'laz'\nscale = 0.03"),
        ("las", "format = 'las'\noffset = [430000.0, 4511000.0, 0.0]"),
    ] {
        let folder = at.path().join("out");
        fs::create_dir_all(&folder).unwrap();
        let outputs = write_each(&inputs, &keys(&folder, more), |_, _| true).unwrap();
        for (input, output) in inputs.iter().zip(&outputs) {
            let one = at.path().join("one").with_extension(extension);
            convert_one(std::slice::from_ref(input), &one, more);
            assert_equal_files(&one, output);
        }
        fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn ply_outputs_have_their_own_comments() {
    let at = tempfile::tempdir().unwrap();
    let inputs: Vec<PathBuf> = (0..3)
        .map(|n| {
            let text = format!(
                "ply\nformat ascii 1.0\ncomment scan {n}\nobj_info station {n}\n\
                 element vertex 2\nproperty double x\nproperty double y\nproperty double z\n\
                 property uchar tag\nend_header\n{n}.5 0 0 {n}\n{n}.25 1 2 {n}\n"
            );
            crate::support::ply::file(at.path(), &format!("{n}.ply"), text)
        })
        .collect();
    let folder = at.path().join("out");
    fs::create_dir(&folder).unwrap();
    let outputs = write_each(&inputs, &keys(&folder, ""), |n, i| n < 2 && i >= n as u64).unwrap();
    for (n, output) in outputs.iter().enumerate() {
        let text = fs::read_to_string(output).unwrap();
        for told in [format!("comment scan {n}\n"), format!("obj_info station {n}\n")] {
            assert_eq!(text.matches(told.trim_end()).count(), 1, "{text}");
        }
        assert_eq!(text.matches("comment scan").count(), 1, "{text}");
        assert!(text.contains(&format!("element vertex {}\n", 2 - n)), "{text}");
        assert_eq!(text.ends_with(&format!("{n}.25 1 2 {n}\n")), n < 2, "{text}");
    }
}

#[test]
fn outputs_are_named_after_their_inputs() {
    let at = tempfile::tempdir().unwrap();
    let names = ["a.las", "b.x.LAS", "c.laz", "tile.12"];
    let inputs: Vec<PathBuf> = names.iter().map(|n| at.path().join(n)).collect();
    for input in &inputs[..3] {
        las(input, [0.0; 3], 5, 1);
    }
    fs::copy(&inputs[2], &inputs[3]).unwrap();
    let of = |inputs: &[PathBuf], more: &str| -> Vec<String> {
        let name = |p: PathBuf| p.file_name().unwrap().to_str().unwrap().to_owned();
        let folder = at.path().join("new");
        named(inputs, &keys(&folder, more)).unwrap().into_iter().map(name).collect()
    };
    assert_eq!(of(&inputs[..3], ""), ["a.las", "b.x.LAS", "c.laz"]);
    assert_eq!(of(&inputs[..3], "format = 'laz'"), ["a.laz", "b.x.laz", "c.laz"]);
    assert_eq!(of(&inputs[..3], "format = 'ply'"), ["a.ply", "b.x.ply", "c.ply"]);
    assert!(!at.path().join("new").exists(), "naming makes nothing");
    let (source, _) = ends(&inputs[..1], &keys(at.path(), "")).unwrap();
    let text = "[[stage]]\nkind = 'read'\npath = 'x.las'\n[[stage]]\nkind = 'write'\nfolder = 'x'";
    let mut parsed = Graph::parse(text, "t", &Registry::builtin()).unwrap();
    let Some(pointmill::stage::Role::Sink(sink)) = parsed.stages.pop().map(|s| s.role) else {
        panic!("no sink")
    };
    assert_eq!(sink.path(), Path::new("x"));
    assert!(sink.each_input(&[]).is_err(), "points of no file have no output of their own");
    assert!(sink.create(Path::new("y"), source.schema(), source.metadata(), true).is_err());
}

#[test]
fn an_output_of_two_inputs_or_over_an_input_is_refused() {
    let at = tempfile::tempdir().unwrap();
    let file = |name: &str| {
        let path = at.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        las(&path, [0.0; 3], 5, 1);
        path
    };
    let (a, b, c) = (file("one/a.las"), file("two/a.las"), file("two/c.laz"));
    let told = |inputs: &[&PathBuf], folder: &str, more: &str| {
        let inputs: Vec<PathBuf> = inputs.iter().map(|p| (*p).clone()).collect();
        let error = named(&inputs, &keys(&at.path().join(folder), more)).unwrap_err();
        error.to_string()
    };
    let twice = told(&[&a, &c, &b], "new", "");
    assert!(twice.contains(a.to_str().unwrap()) && twice.contains(b.to_str().unwrap()), "{twice}");
    fs::create_dir(at.path().join("links")).unwrap();
    std::os::unix::fs::symlink(&c, at.path().join("links/a.laz")).unwrap();
    let planned = |folder: &str, more: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = ['{}', '{}']\n[[stage]]\nkind = 'write'\n{}\n",
            a.display(),
            c.display(),
            keys(&at.path().join(folder), more)
        );
        let pipeline = Graph::parse(&text, "p.toml", &Registry::builtin()).unwrap();
        pipeline.plan(&Overrides::default()).err().unwrap().to_string()
    };
    let over = planned("one", "");
    assert!(over.ends_with("one/a.las: this is an input: it cannot be written over"), "{over}");
    let linked = planned("links", "format = 'laz'");
    assert!(linked.contains("links/a.laz: this is the input "), "{linked}");
    assert!(told(&[&a], "two/c.laz", "").contains("no folder"));
    assert!(told(&[&a], "new/deep", "").contains("does not exist"));
    assert!(told(&[&a], "new", "encoding = 'ascii'").contains("`write.encoding` is for ply"));
}

#[test]
fn a_write_stage_takes_a_path_or_a_folder() {
    let parse = |keys: &str| {
        let text = format!(
            "[[stage]]\nkind = 'read'\npath = 'in.las'\n[[stage]]\nkind = 'write'\n{keys}\n"
        );
        Graph::parse(&text, "p.toml", &Registry::builtin())
    };
    let told = |keys: &str| parse(keys).unwrap_err().to_string();
    assert!(parse("folder = 'out'").is_ok() && parse("path = 'out.las'").is_ok());
    assert!(told("").contains("a `write` needs `write.path` or `write.folder`"));
    let both = told("path = 'out.las'\nfolder = 'out'");
    assert!(both.contains("p.toml:7:") && both.contains("give one of them"), "{both}");
    assert!(
        told("folder = 'out'\nformat = 'las'\nencoding = 'ascii'").contains("`write.encoding`")
    );
    // An argument takes the place of the other key.
    let text =
        "[[stage]]\nkind = 'read'\npath = 'in.las'\n[[stage]]\nkind = 'write'\npath = 'out.las'\n";
    let set = [pointmill::Set::parse("write.folder=out").unwrap()];
    let pipeline = Graph::parse_with(text, "p.toml", &Registry::builtin(), &set).unwrap();
    let Some(pointmill::stage::Role::Sink(sink)) = pipeline.stages.last().map(|s| &s.role) else {
        panic!("no sink")
    };
    assert_eq!(sink.path(), Path::new("out"));
}

#[test]
fn an_input_that_changed_since_is_told() {
    let at = tempfile::tempdir().unwrap();
    let inputs = three(at.path());
    let source = open(&inputs).unwrap();
    assert!(source.metadata_of(0).is_ok() && source.metadata_of(3).is_err());
    las(&inputs[0], [431_000.38, 4_512_000.0, 100.0], 12_000, 1);
    let told = source.metadata_of(0).unwrap_err();
    assert!(told.to_string().contains("changed") && told.path() == Some(inputs[0].as_path()));
}

#[test]
fn a_record_of_no_input_is_refused_when_it_cannot_move() {
    let at = tempfile::tempdir().unwrap();
    let inputs = three(at.path());
    let (source, sink) = ends(&inputs, &keys(at.path(), "format = 'ply'")).unwrap();
    let each = sink.each_input(&source.inputs()).unwrap().unwrap();
    let output = at.path().join("staged");
    let sink =
        each[2].create(&output, source.schema(), &source.metadata_of(2).unwrap(), false).unwrap();
    let mut record = vec![0u8; source.schema().stride];
    record[..4].copy_from_slice(&i32::MIN.to_le_bytes());
    let mut batch = pointmill::point::PointBatch::new(source.schema().clone(), 1);
    batch.extend(&record);
    let told = sink.encoder().encode(&batch).unwrap_err();
    assert_eq!(told.path(), Some(output.as_path()));
    assert!(told.to_string().contains("-2147483648"), "{told}");
}
