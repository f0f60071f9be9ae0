//! Inputs that are something else than their name says, or that cannot be read at positions, are
//! called what they are, alike by every command.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::support::case_file;
use crate::support::command::{command, ended};

/// Exit code and standard error of the program with `arguments`, within ten seconds.
fn told<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> (i32, String) {
    let done = ended(command(Path::new("."), arguments), Duration::from_secs(10));
    (done.status.code().expect("it hangs"), String::from_utf8(done.stderr).unwrap())
}

#[test]
fn other_formats_under_a_known_name_are_called_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.las");
    for (name, what, remedy) in [
        ("160-empty.las", "this is an empty file", "make or copy it again"),
        ("160-empty.ply", "this is an empty file", "make or copy it again"),
        ("160-lfs.laz", "this is a Git LFS pointer", "git lfs pull"),
        ("160-welllog.las", "this is a well log", "convert it"),
        ("118-vlrcount.las", "3 variable length records do not fit", "record count"),
        ("20a-count-too-many.las", "ends after 5 of the 9 points", "header's count"),
    ] {
        let input = case_file(name);
        let convert = [Path::new("convert"), &input, Path::new("-o"), &out];
        for arguments in [&[Path::new("info"), &input][..], &convert] {
            let (code, text) = told(arguments);
            assert_eq!(code, 1, "{name}: {text}");
            assert!(text.contains(what) && text.contains(remedy), "{name}: {text}");
        }
        assert!(!out.exists());
    }
    // `info` goes by the bytes, all others by the name.
    let input = case_file("160-las-named.ply");
    assert_eq!(told(&[Path::new("info"), &input]).0, 0);
    let (code, text) = told(&[Path::new("convert"), &input, Path::new("-o"), &out]);
    assert_eq!(code, 1);
    assert!(text.contains("this is a LAS or LAZ file, not a PLY file"), "{text}");
}

#[test]
fn extensions_of_formats_that_are_not_read_are_told_by_name() {
    for (name, what) in
        [("x.zlas", "Esri's zLAS"), ("x.drc", "Draco"), ("x.neu", "a text of numbers")]
    {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join(name);
        std::fs::write(&input, b"").unwrap();
        let (code, text) =
            told(&[Path::new("convert"), &input, Path::new("-o"), Path::new("out.las")]);
        assert_eq!(code, 2, "{text}");
        assert!(text.contains(&format!("` is {what}, which is not read")), "{text}");
        let (code, text) = told(&["convert", "a.las", "-o", name]);
        assert_eq!(code, 2, "{text}");
        assert!(text.contains(&format!("` is {what}, which is not written")), "{text}");
    }
}

#[test]
fn pipes_folders_and_devices_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["pipe.las", "pipe.ply", "pipe.toml"] {
        assert!(Command::new("mkfifo").arg(at(name)).status().unwrap().success());
    }
    std::fs::create_dir(at("folder.toml")).unwrap();
    let out = at("out.las");
    for (first, path, what) in [
        ("info", at("pipe.las"), "a pipe"),
        ("convert", at("pipe.las"), "a pipe"),
        ("reduce", at("pipe.ply"), "a pipe"),
        ("run", at("pipe.toml"), "a pipe"),
        ("plan", at("folder.toml"), "a folder"),
        ("check", PathBuf::from("/dev/zero"), "a device"),
        ("info", PathBuf::from("/dev/zero"), "a device"),
    ] {
        let mut arguments = vec![Path::new(first), &path];
        if ["convert", "reduce"].contains(&first) {
            arguments.extend([Path::new("-o"), &out]);
        }
        let (code, text) = told(&arguments);
        assert_eq!(code, 1, "{first}: {text}");
        assert!(text.contains(&format!("this is {what}, not a plain file")), "{first}: {text}");
    }
    // A scan given as a pipeline is not read as a whole first.
    let scan = at("scan.toml");
    std::fs::File::create(&scan).unwrap().set_len(1 << 36).unwrap();
    let (code, text) = told(&[Path::new("run"), &scan]);
    assert_eq!(code, 2);
    assert!(text.contains("this is no pipeline: it has 68719476736 bytes"), "{text}");
}

#[test]
fn outputs_that_take_the_names_of_inputs_are_copc_where_they_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("in")).unwrap();
    std::fs::copy(case_file("80j-count-fewer.laz"), at("in/tile.copc.laz")).unwrap();
    let (input, [one, two]) = (at("in/tile.copc.laz"), [at("one"), at("two")]);
    std::fs::create_dir(&one).unwrap();
    let (code, text) = told(&[Path::new("convert"), &input, Path::new("-o"), &one]);
    assert_eq!(code, 0, "{text}");
    let (code, text) = told(&[Path::new("reduce"), &input, Path::new("--outdir"), &two]);
    assert_eq!(code, 0, "{text}");
    // A conversion for each input, and one scan that is cut into its inputs again.
    for (folder, expected) in [(one, "tile.copc.laz"), (two, "tile.laz")] {
        let names: Vec<_> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, [expected]);
    }
}

#[test]
fn names_that_are_no_text_are_refused_alike() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsStr::from_bytes(b"\xff.las");
    std::fs::copy(case_file("20b-count-too-few.las"), folder.path().join(name)).unwrap();
    let (pattern, out) = (folder.path().join("*.las"), folder.path().join("out.laz"));
    for command in ["info", "convert", "reduce"] {
        for input in [folder.path(), &pattern] {
            let mut arguments = vec![Path::new(command), input];
            if command != "info" {
                arguments.extend([Path::new("-o"), &out]);
            }
            let (code, text) = told(&arguments);
            assert_eq!(code, 2, "{command}: {text}");
            assert!(text.contains("the name is not UTF-8 text"), "{command}: {text}");
        }
    }
}
