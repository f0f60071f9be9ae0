//! `picture`: scans of every format side by side, in a PNG file that appears complete or not at
//! all.

use std::fs;

use crate::support::command::{done, fails, pointmill, scans};

#[test]
fn scans_of_all_formats_are_drawn_side_by_side() {
    let at = scans(&["a.laz", "b.ply"]);
    let args = ["picture", "a.laz", "b.ply", "-o", "both.png", "--from", "south", "--width", "300"];
    let told = done(at.path(), &args);
    let lines: Vec<&str> =
        told.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert_eq!(lines, ["scan", "scan", "colours", "pixel", "output"], "{told}");
    let bytes = fs::read(at.path().join("both.png")).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    let size = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    assert!(size(16) <= 300 && size(16) > 200, "{} pixels wide", size(16));
    // Drawn again it is the same file.
    done(at.path(), &[&args[..], &["--threads", "1"]].concat());
    assert!(fs::read(at.path().join("both.png")).unwrap() == bytes);
    assert_eq!(fs::read_dir(at.path()).unwrap().count(), 3, "nothing else is left");
}

#[test]
fn what_is_wrong_with_a_picture_is_told() {
    let at = scans(&["a.laz"]);
    let input = fs::read(at.path().join("a.laz")).unwrap();
    fails(
        at.path(),
        &["picture", "a.laz", "-o", "a.jpg"],
        2,
        &["error: -o: a picture is a PNG file", "| a.jpg\n   | ^^^^^\n   = write -o a.png"],
    );
    fs::hard_link(at.path().join("a.laz"), at.path().join("a.png")).unwrap();
    fails(at.path(), &["picture", "a.laz", "-o", "a.png"], 2, &["a.png: ", "is the input a.laz"]);
    assert!(fs::read(at.path().join("a.laz")).unwrap() == input);
    fails(at.path(), &["picture", "a.laz", "-o", "p.png", "--width", "5"], 2, &["64 to 4096"]);
    fails(at.path(), &["picture", "none.laz", "-o", "p.png"], 1, &["none.laz: "]);
    assert!(!at.path().join("p.png").exists());
}

#[test]
fn a_scan_without_colours_is_drawn_and_told_to_be_black() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let ply = |red: u8| {
        let vertices: String =
            (0..9).map(|i| format!("{}.00001 {}.00002 {i} {red} 0 0 0\n", i % 3, i / 3)).collect();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 9\nproperty double x\nproperty double y\n\
             property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
             property ushort intensity\nend_header\n{vertices}"
        )
    };
    fs::write(at.join("none.ply"), ply(0)).unwrap();
    fs::write(at.join("red.ply"), ply(9)).unwrap();
    let drawn = |by: &str| {
        let both = ["picture", "none.ply", "red.ply", "-o", "p.png", "--by", by, "--width", "4096"];
        let (code, stdout, stderr) = pointmill(at, &both);
        assert_eq!(code, 0, "{stderr}");
        assert!(stdout.contains("pixel      0.00097"), "{stdout}");
        stderr
    };
    let told = "warning: none.ply: all colours are 0, so that the scan is drawn black: use \
                `--by height` or";
    for by in ["color", "colour"] {
        let stderr = drawn(by);
        assert!(stderr.starts_with(told) && stderr.lines().count() == 1, "{stderr}");
    }
    let stderr = drawn("intensity");
    assert_eq!(stderr.matches("all intensities are 0").count(), 2, "{stderr}");
    assert_eq!(drawn("height"), "");
}

#[test]
fn what_a_picture_lacks_is_told_in_words_and_with_what_can_be_done() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
                  property double z\nproperty ushort intensity\nend_header\n";
    let points = "1 2 3 9\nnan 2 3 9\n2 2 inf 9\n4 2 3 9\n";
    fs::write(at.join("a.ply"), format!("{header}{points}")).unwrap();
    let told =
        ["error: a.ply: the scan has no colours\nhelp: use `--by height` or `--by intensity`\n"];
    fails(at, &["picture", "a.ply", "-o", "p.png", "--by", "color"], 2, &told);
    let class = ["error: a.ply: the scan has no classes\n"];
    fails(at, &["picture", "a.ply", "-o", "p.png", "--by", "class"], 2, &class);
    let (code, stdout, stderr) = pointmill(at, &["picture", "a.ply", "-o", "p.png"]);
    assert_eq!((code, stdout.contains("a.ply, 2 points\n")), (0, true), "{stdout}{stderr}");
    let nowhere = "warning: a.ply: 2 points cannot be drawn: their coordinates are not finite";
    assert!(stderr.starts_with(nowhere) && stderr.lines().count() == 1, "{stderr}");
    assert!(stdout.contains("1600 × 64 pixels"), "a line of points: {stdout}");
}

#[test]
fn every_format_that_is_read_is_drawn() {
    let at = scans(&["a.laz"]);
    let at = at.path();
    let mut names = vec!["a.laz".to_owned()];
    for extension in ["las", "copc.laz", "ply", "pcd", "e57", "csv", "xyz"] {
        let name = format!("b.{extension}");
        done(at, &["convert", "a.laz", "-o", &name, "--quiet"]);
        names.push(name);
    }
    let corners = [[0, 0, 0], [9, 0, 1], [0, 9, 2], [9, 9, 5]];
    let rows = |before: &str| -> String {
        let row = |[x, y, z]: [i32; 3]| format!("{before}{x} {y} {z}\n");
        corners.into_iter().map(row).collect()
    };
    let facet = format!(
        "solid s\nfacet normal 0 0 1\nouter loop\n{}endloop\nendfacet\nendsolid s\n",
        rows("vertex ").lines().take(3).map(|row| format!("{row}\n")).collect::<String>()
    );
    let pose = "1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let cells: String = rows("").lines().map(|row| format!("{row} 0.5\n")).collect();
    for (name, text) in [
        ("c.obj", rows("v ")),
        ("c.off", format!("OFF\n4 0 0\n{}", rows(""))),
        ("c.stl", facet),
        ("c.pts", format!("4\n{}", rows("").replace('\n', " 9 1 2 3\n"))),
        ("c.ptx", format!("2\n2\n0 0 0\n{pose}{cells}")),
    ] {
        fs::write(at.join(name), text).unwrap();
        names.push(name.to_owned());
    }
    for name in &names {
        let (code, told, error) = pointmill(at, &["picture", name, "-o", "p.png", "--width", "90"]);
        let points = match name.as_str() {
            "c.stl" | "c.ptx" => "3 points",
            name if name.starts_with('c') => "4 points",
            _ => "3,000 points",
        };
        assert!(code == 0 && told.contains(&format!("{name}, {points}")), "{told}{error}");
        fs::remove_file(at.join("p.png")).unwrap();
    }
    // Before and after, whatever the formats.
    done(at, &["picture", "b.e57", "b.copc.laz", "b.csv", "-o", "p.png", "--width", "300"]);
}

/// Width, height and how many pixels of each hundred are white.
fn white(path: &std::path::Path) -> (u32, u32, usize) {
    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let white = pixels.chunks_exact(3).filter(|pixel| **pixel == [255; 3]).count();
    (info.width, info.height, 100 * white / (info.width * info.height) as usize)
}

#[test]
fn of_copc_the_levels_are_read_that_the_pixels_need() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    done(at, &["synth", "als", "-n", "400k", "-o", "a.laz"]);
    done(at, &["convert", "a.laz", "-o", "a.copc.laz", "--quiet"]);
    let drawn = |input: &str, output: &str, more: &[&str]| -> (u64, u64) {
        let all = [&["picture", input, "-o", output], more].concat();
        let told = done(at, &all);
        let counts =
            told.split_once(&format!("{input}, ")).unwrap().1.split_once(" points").unwrap();
        let number = |text: &str| text.replace(',', "").parse().unwrap();
        match counts.0.split_once(" of ") {
            Some((some, all)) => (number(some), number(all)),
            None => (number(counts.0), number(counts.0)),
        }
    };
    let small = ["--width", "128"];
    let (some, all) = drawn("a.copc.laz", "some.png", &small);
    assert!(all == 400_000 && (10_000..200_000).contains(&some), "{some} of {all}");
    assert_eq!(drawn("a.laz", "all.png", &small), (400_000, 400_000));
    let [some_seen, all_seen] = ["some.png", "all.png"].map(|name| white(&at.join(name)));
    assert_eq!((some_seen.0, some_seen.1), (all_seen.0, all_seen.1), "the frame is the same");
    assert!(some_seen.2 <= 5 && all_seen.2 <= 2, "{some_seen:?} {all_seen:?}");
    let bytes = fs::read(at.join("some.png")).unwrap();
    drawn("a.copc.laz", "some.png", &["--width", "128", "--threads", "1"]);
    assert!(fs::read(at.join("some.png")).unwrap() == bytes);
    let (more, _) = drawn("a.copc.laz", "p.png", &["--width", "300"]);
    assert!(more > some, "more pixels have more levels: {more} {some}");
    assert_eq!(drawn("a.copc.laz", "p.png", &["--width", "2000"]), (400_000, 400_000));
    // An octree that cannot be followed is none.
    let mut broken = fs::read(at.join("a.copc.laz")).unwrap();
    broken[429 + 24..][..8].copy_from_slice(&f64::NAN.to_le_bytes());
    fs::write(at.join("broken.copc.laz"), broken).unwrap();
    assert_eq!(drawn("broken.copc.laz", "p.png", &small), (400_000, 400_000));
    // A header that claims a box a hundred times as wide is not believed.
    let mut wide = fs::read(at.join("a.copc.laz")).unwrap();
    wide[179..187].copy_from_slice(&1e8f64.to_le_bytes());
    fs::write(at.join("wide.copc.laz"), wide).unwrap();
    done(at, &["picture", "wide.copc.laz", "-o", "p.png", "--width", "128"]);
    assert!(white(&at.join("p.png")).2 <= 5);
}
