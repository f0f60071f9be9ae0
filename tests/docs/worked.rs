//! The worked example of each stage: a command on a made-up scan, and what it prints, which is made
//! again with the pages.

use std::fs;
use std::path::Path;

use super::root;
use crate::support::command::{done, pointmill};

/// The largest picture in bytes.
const LARGEST: u64 = 60 << 10;

/// A stage, what its example shows, and the pipeline behind `read scan.laz ! `. Those with a
/// picture write `after.laz`.
const EXAMPLES: [(&str, &str, &str); 28] = [
    ("read", "Two files become one.", "write copy.laz"),
    ("synth", "A made-up scan of 5,000 points.", "synth als points=5k ! write made.laz"),
    ("merge", "Two sources are one scan.", "merge from=[a,b] ! write both.laz"),
    (
        "assign",
        "What is high up among the points of class 5 becomes class 6.",
        "assign set=\"Classification = 6\" where=\"Classification == 5 and Z > 140\" ! write assigned.laz",
    ),
    (
        "crop",
        "A triangle of the scan is kept.",
        "crop polygon=\"POLYGON((350000 5600000, 350020 5600000, 350010 5600020))\" ! write after.laz",
    ),
    ("drop", "Trees and roofs go.", "drop classes=[5,6] ! write ground.laz"),
    (
        "filter",
        "What is high and no roof stays.",
        "filter where=\"Z > 140 and Classification != 6\" ! write high.laz",
    ),
    (
        "stats",
        "Heights and intensities of the ground.",
        "stats dimensions=[Z,Intensity] classes=[2] ! discard",
    ),
    (
        "discard",
        "How many points are high, and no file is written.",
        "tap where=\"Z > 140\" ! discard",
    ),
    ("tap", "How many points are on the ground.", "tap classes=[2] name=ground ! write copy.laz"),
    ("transform", "The scan goes down by 100.", "transform translate=[0,0,-100] ! write low.laz"),
    (
        "cells",
        "A fifth of the points stays, more of them where the surface bends.",
        "normals ! cells keep=20% ! median ! write after.laz",
    ),
    (
        "graded",
        "A twentieth of the points stays: those that say most of the surface.",
        "graded keep=5% ! write after.laz",
    ),
    (
        "cut",
        "Of a reduction with ranks, of which the file has them, a tenth of the points stays.",
        "cut keep=10% ! write coarse.laz",
    ),
    ("grid", "One point in each cube of side 2 stays.", "grid side=2 ! write after.laz"),
    (
        "median",
        "The point in the middle of each cell stays.",
        "normals ! cells side=4 max_angle=20deg ! median ! write reduced.laz",
    ),
    (
        "normals",
        "The normals are written as dimensions of their own.",
        "normals ! write with-normals.laz dimensions=[NormalX,NormalY,NormalZ]",
    ),
    (
        "outliers",
        "What is farther from its neighbours than most points are from theirs goes.",
        "outliers ! write after.laz",
    ),
    (
        "sample",
        "What stays is at least 2 from all else that stays.",
        "sample distance=2 ! write after.laz",
    ),
    (
        "smooth",
        "Every point goes to the mean of its neighbourhood, unless that is more than a metre away.",
        "smooth max_distance=1 ! write smooth.laz",
    ),
    (
        "orient",
        "Normals agree with those of their neighbours, and look up at the highest point.",
        "normals ! orient by=propagation ! write seen.laz dimensions=[NormalX,NormalY,NormalZ]",
    ),
    (
        "gaussian-image",
        "Where normals agree a point stays, in the middle of those that it stands for.",
        "normals ! gaussian-image side=4 ! median pick=centroid ! write after.laz",
    ),
    (
        "scanline",
        "Of each scan line those points stay that tell the others within 20 cm.",
        "scanline max_distance=0.2 ! write after.laz",
    ),
    (
        "triangles",
        "A tenth of the points stays, those of the mesh that is left.",
        "triangles keep=10% ! write after.laz",
    ),
    (
        "wavelet",
        "A tenth of the points stays, more of them where depths change.",
        "wavelet keep=10% pixels=128 ! write after.laz",
    ),
    (
        "fourier",
        "A tenth of the points stays, in rows, at the depths of the low waves.",
        "fourier keep=10% pixels=128 ! write after.laz",
    ),
    (
        "mesh",
        "The points that tell most of the surface become triangles.",
        "graded keep=20% ! mesh surface.ply max_radius=8",
    ),
    ("write", "A LAZ file becomes a PLY text.", "write copy.ply encoding=ascii"),
];

/// The section of the page of stage `kind` that shows it at work. Its picture, if it has one, is
/// compared with the one in the repository, or written.
pub fn section(kind: &str) -> String {
    let (_, says, pipeline) =
        EXAMPLES.iter().find(|(of, ..)| *of == kind).expect("each stage has an example");
    let at = tempfile::tempdir().unwrap();
    let synth = ["synth", "als", "-n", "5k", "-o"];
    done(at.path(), &[&synth[..], &["scan.laz"]].concat());
    done(at.path(), &[&synth[..], &["more.laz", "--seed", "1"]].concat());
    if kind == "cut" {
        let ranked = ["reduce", "scan.laz", "-o", "ranked.laz", "--keep", "2k", "--ranks"];
        done(at.path(), &ranked);
    }
    let line = match kind {
        "cut" => format!("read ranked.laz ! {pipeline}"),
        "synth" => (*pipeline).to_owned(),
        "read" => format!("read [scan.laz,more.laz] ! {pipeline}"),
        "merge" => format!("read scan.laz name=a ! read more.laz name=b ! {pipeline}"),
        _ => format!("read scan.laz ! {pipeline}"),
    };
    let (code, stdout, stderr) = pointmill(at.path(), &["run", &line]);
    assert_eq!(code, 0, "{line}: {stderr}");
    let differs = |line: &&str| line.starts_with("memory ") || line.starts_with("time ");
    let said: Vec<&str> = stdout.lines().filter(|line| !differs(line)).map(str::trim_end).collect();
    assert!(said[0].starts_with("points "), "{stdout}");
    let made = match line.contains("more.laz") {
        _ if kind == "cut" => {
            "`ranked.laz` is `pointmill reduce scan.laz -o ranked.laz --keep 2k --ranks`"
        }
        true => {
            "`scan.laz` is `pointmill synth als -n 5k -o scan.laz`, and `more.laz` with `--seed 1`"
        }
        false => "`scan.laz` is `pointmill synth als -n 5k -o scan.laz`",
    };
    let said = said.join("\n");
    let mut out = format!(
        "\n## Example\n\n{says} {made}.\n\n```sh\npointmill run '{line}'\n```\n\n```text\n{said}\n```\n"
    );
    if at.path().join("after.laz").exists() {
        draw(at.path(), kind);
        out += &format!("\n![before and after](../images/stages/{kind}.png)\n");
    }
    out
}

/// Draws what came out beside what was read.
fn draw(at: &Path, kind: &str) {
    let draw = ["picture", "scan.laz", "after.laz", "-o", "drawn.png", "--width", "480"];
    done(at, &[&draw[..], &["--by", "class"]].concat());
    let (drawn, kept) =
        (at.join("drawn.png"), root().join(format!("docs/images/stages/{kind}.png")));
    assert!(fs::metadata(&drawn).unwrap().len() <= LARGEST, "the picture of {kind} is too large");
    let drawn = fs::read(drawn).unwrap();
    if std::env::var_os("POINTMILL_WRITE_DOCS").is_some() {
        fs::create_dir_all(kept.parent().unwrap()).unwrap();
        fs::write(&kept, drawn).unwrap();
        return;
    }
    assert!(fs::read(&kept).unwrap_or_default() == drawn, "{} is another", kept.display());
}
