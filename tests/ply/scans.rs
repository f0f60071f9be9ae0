//! PLY files of other programs, and what becomes of them when they are cut short or damaged.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::support::ply::{file, read, write};
use pointmill::ErrorKind;
use pointmill::internals;
use pointmill::internals::ply::{Encoding, PlyOptions};
use proptest::prelude::*;

/// The PLY files of the folder of real scans and their numbers of points as its manifest has them.
fn scans() -> BTreeMap<PathBuf, u64> {
    let folder = crate::support::scans();
    let manifest = std::fs::read_to_string(folder.join("MANIFEST.tsv")).unwrap();
    let mut lines = manifest.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let column = |name: &str| head.iter().position(|c| *c == name).unwrap();
    let (path, points) = (column("path"), column("points"));
    lines
        .filter(|row| row[path].ends_with(".ply"))
        .map(|row| (folder.join(row[path]), row[points].parse().unwrap()))
        .collect()
}

/// Files without vertices of x, y and z, and what is said of them.
const REFUSED: [(&str, &str); 10] = [
    ("pdal/ply/no_vertex.ply", "no element at all"),
    ("pdal/ply/sized_dims.ply", "no property z"),
    ("pdal/ply/unsized_dims.ply", "no property z"),
    ("ply-rs-bw/all_atomic_types_ok_ascii.ply", "the file has `point`"),
    ("ply-rs-bw/exponent_values_ok_ascii.ply", "the file has `point`"),
    ("ply-rs-bw/header_min_ok_ascii.ply", "no element at all"),
    ("ply-rs-bw/leading_spaces_ok_ascii.ply", "the file has `point`"),
    ("ply-rs-bw/single_elements_err_ascii.ply", "the file has `point`"),
    ("ply-rs-bw/single_elements_ok_ascii.ply", "the file has `point`"),
    ("trimesh/emptyIO/ply_empty_header.ply", "no element at all"),
];

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn every_scan_reads_with_all_its_points_or_says_what_it_lacks() {
    let scans = scans();
    let folder = tempfile::tempdir().unwrap();
    let (mut read_files, mut refused) = (0, 0);
    for (path, points) in &scans {
        let told = REFUSED.iter().find(|(name, _)| path.ends_with(name));
        match (read(path, 10_000), told) {
            (Err(error), Some((_, message))) => {
                assert!(error.to_string().contains(message), "{error}");
                assert_eq!(error.kind(), ErrorKind::Data);
                refused += 1;
            }
            (Ok((schema, metadata, all)), None) => {
                // Two files that the manifest's reader could not read; their headers count so many.
                let points = match path.file_name().and_then(|n| n.to_str()) {
                    Some("simple_text.ply") => 3,
                    Some("fuze_ascii.ply") => 502,
                    _ => *points,
                };
                assert_eq!((all.len() / schema.stride) as u64, points, "{}", path.display());
                for encoding in [None, Some(Encoding::Ascii), Some(Encoding::BinaryBigEndian)] {
                    let out = folder.path().join("out.ply");
                    let options = PlyOptions { encoding, ..PlyOptions::default() };
                    write(&out, &options, (&schema, &metadata, &all), None, 4096).unwrap();
                    let again = read(&out, 10_000).unwrap();
                    let back = folder.path().join("back.ply");
                    let options = PlyOptions {
                        encoding: Some(internals::ply::describe(path).unwrap().encoding),
                        ..PlyOptions::default()
                    };
                    write(&back, &options, (&again.0, &again.1, &again.2), None, 999).unwrap();
                    assert_eq!(read(&back, 77).unwrap().2, all, "{} {encoding:?}", path.display());
                }
                read_files += 1;
            }
            (Ok(_), Some(_)) => panic!("{} was read", path.display()),
            (Err(error), None) => panic!("{error:?}"),
        }
    }
    assert_eq!((read_files, refused), (scans.len() - REFUSED.len(), REFUSED.len()));
    assert!(read_files >= 40);
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn a_scan_cut_anywhere_is_read_as_far_as_promised_or_refused() {
    let scans = scans();
    let folder = tempfile::tempdir().unwrap();
    let mut cuts = 0;
    for (path, points) in scans.iter().filter(|(_, points)| **points > 0) {
        let whole = std::fs::read(path).unwrap();
        if REFUSED.iter().any(|(name, _)| path.ends_with(name)) || whole.len() > 2000 {
            continue;
        }
        for length in 0..whole.len() {
            let cut = file(folder.path(), "cut.ply", &whole[..length]);
            cuts += 1;
            match read(&cut, 1000) {
                // Faces were cut off, or the digits of the last number.
                Ok((schema, _, all)) => assert_eq!((all.len() / schema.stride) as u64, *points),
                Err(error) => assert_eq!(error.kind(), ErrorKind::Data, "{error:?}"),
            }
        }
    }
    assert!(cuts > 5_000, "{cuts}");
}

fn samples() -> Vec<Vec<u8>> {
    let mut list = b"ply\nformat binary_little_endian 1.0\nelement face 2\n\
        property list uchar uint i\nelement vertex 3\nproperty float x\nproperty double y\n\
        property short z\nend_header\n"
        .to_vec();
    list.extend([1, 0, 0, 0, 0, 0]);
    list.extend([7; 42]);
    let ascii = b"ply\r\nformat ascii 1.0\r\ncomment crs: WGS 84\r\ncomment dimension q: r s\r\n\
        element face 1\r\nproperty list uchar int i\r\nelement vertex 2\r\nproperty float x\r\n\
        property int8 y\r\nproperty float64 z\r\nproperty uint64 q\r\nend_header\r\n\
        3 0 1 1\r\n1.5 -2 3e10 9\r\n4 5 6 7\r\n"
        .to_vec();
    vec![list, ascii]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_are_read_or_refused(
        which in 0..2usize,
        damage in prop::collection::vec((any::<prop::sample::Index>(), 0..6u8, any::<u8>()), 1..6),
    ) {
        const WORDS: [&str; 16] = [
            "18446744073709551615", "4294967295", "-1", "list ", "vertex", "\n", "\r", "double ",
            "element vertex 99999999999\n", "property list uint double x\n", "nan", "end_header\n",
            "comment crs: ", "comment crs+ ", "\ncomment dimension x: ", "comment .",
        ];
        let mut bytes = samples().swap_remove(which);
        for (at, how, with) in damage {
            let at = at.index(bytes.len().max(1));
            match how {
                0 => bytes.truncate(at),
                1 if at < bytes.len() => bytes[at] = with,
                2 if at < bytes.len() => {
                    bytes.remove(at);
                }
                3 if at < bytes.len() => bytes[at] ^= 1 << (with % 8),
                _ => {
                    let word = WORDS[usize::from(with) % WORDS.len()];
                    bytes.splice(at..at, word.bytes());
                }
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "damaged.ply", &bytes);
        let _ = internals::ply::describe(&path);
        match read(&path, 64) {
            Ok((schema, metadata, all)) => {
                // What reads, writes and reads again.
                prop_assert!(all.len() <= 8 * bytes.len());
                let out = folder.path().join("out.ply");
                write(&out, &PlyOptions::default(), (&schema, &metadata, &all), None, 2).unwrap();
                let again = read(&out, 64).unwrap();
                prop_assert_eq!(again.2.len(), all.len());
                prop_assert_eq!(&again.0.dimensions, &schema.dimensions);
                let comments = metadata.comments.iter().map(|c| c.replace('\r', " "));
                prop_assert_eq!(again.1.comments, comments.collect::<Vec<_>>());
                prop_assert_eq!(again.1.crs, metadata.crs.map(|crs| crs.replace('\r', " ")));
            }
            Err(error) => prop_assert_eq!(error.kind(), ErrorKind::Data, "{:?}", error),
        }
    }
}
