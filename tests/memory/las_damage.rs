//! Cut and flipped files: an error or points, never a panic, a hang or memory for what is only
//! claimed.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::support::allocator;
use crate::support::las::{LAS, LAZ, manifest, write};
use crate::support::random::Random;
use crate::support::records::read_source;
use crate::support::scans;
use pointmill::ErrorKind;
use pointmill::io::las::{fresh, layout, open};
use pointmill::point::Scalar;

const MOST_BYTES: usize = 64 << 20;
const MOST_TIME: Duration = Duration::from_secs(20);

/// Reads a damaged file; true if that failed or a warning came of it.
fn survive(path: &Path, bytes: &[u8], what: &str) -> bool {
    std::fs::write(path, bytes).unwrap();
    let start = Instant::now();
    let result = open(&[path.to_owned()]).and_then(|source| {
        assert!(source.part_bytes() < u64::MAX / 2);
        // A claim of billions of points in a small file may be true: it is not read to its end.
        read_source(&*source, 200_000).map(|_| source.warnings().len())
    });
    assert!(start.elapsed() < MOST_TIME, "{what}: {:?}", start.elapsed());
    assert!(allocator::largest() < MOST_BYTES, "{what} made an allocation too large");
    if let Err(error) = &result {
        assert_eq!(error.kind(), ErrorKind::Data, "{what}: {error:?}");
        assert_eq!(error.path(), Some(path), "{what}: {error:?}");
    }
    result.map_or(true, |warnings| warnings > 0)
}

/// Cuts, flips of single bytes and of runs in what describes the points, and anywhere.
fn damage(path: &Path, name: &str, whole: &[u8], rounds: usize, random: &mut Random) -> [usize; 2] {
    let mut failed = [0, 0];
    let start = u32::from_le_bytes(whole[96..100].try_into().unwrap()) as usize;
    for round in 0..rounds {
        let cut = random.below(whole.len());
        let failure = survive(path, &whole[..cut], &format!("{name} cut at {cut}"));
        failed[0] += usize::from(failure);
        let mut bytes = whole.to_vec();
        let len = bytes.len();
        let at = match round % 4 {
            0 => random.below(start.min(len)),
            1 => (start + random.below(8)).min(len - 1),
            2 => len - 1 - random.below(64.min(len)),
            _ => random.below(len),
        };
        let run = 1 + random.below(4);
        for byte in &mut bytes[at..(at + run).min(len)] {
            *byte = random.number() as u8;
        }
        let failure = survive(path, &bytes, &format!("{name} with {run} bytes flipped at {at}"));
        failed[1] += usize::from(failure);
    }
    failed
}

#[test]
fn damaged_files_of_every_format_fail_or_read() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    let mut random = Random(11);
    let mut flips = 0;
    for format in 0..=10 {
        for options in [LAS, LAZ] {
            let extra = [("Extra".to_owned(), Scalar::I32)];
            let schema = Arc::new(layout(format, &extra, [0.01; 3], [0.0; 3]));
            let record = random.bytes(schema.stride);
            let records: Vec<u8> = (0..900)
                .flat_map(|i| {
                    let mut record = record.clone();
                    record[0] = i as u8;
                    record[20] = (i * i) as u8;
                    record
                })
                .collect();
            write(&path, options.clone(), &schema, &fresh(&schema, None), &records).unwrap();
            let whole = std::fs::read(&path).unwrap();
            let name = format!("format {format} {options:?}");
            let failed = damage(&path, &name, &whole, 16, &mut random);
            assert!(failed[0] == 16, "{name}: only {} cuts were noticed", failed[0]);
            flips += failed[1];
        }
    }
    assert!(flips > 60, "only {flips} flips of 352 were noticed");
}

#[test]
fn every_byte_of_headers_and_chunk_tables_can_be_wrong() {
    let _alone = allocator::alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    for format in [1, 7] {
        let schema = Arc::new(layout(format, &[], [0.01; 3], [0.0; 3]));
        let records = vec![1; 50 * schema.stride];
        write(&path, LAZ, &schema, &fresh(&schema, None), &records).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for at in 0..whole.len() {
            for value in [0x00, 0x7f, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                survive(&path, &bytes, &format!("format {format}, byte {at} = {value}"));
            }
        }
    }
}

#[test]
#[ignore = "needs the real scans: POINTMILL_SCANS"]
fn damaged_real_scans_fail_or_read() {
    let _alone = allocator::alone();
    let scans = scans();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    let mut random = Random(23);
    let (mut tested, mut failed) = (0, 0);
    for scan in manifest(&scans) {
        let small = std::fs::metadata(&scan.path).unwrap().len() < 100_000;
        if !small {
            continue;
        }
        let whole = std::fs::read(&scan.path).unwrap();
        failed += damage(&path, &scan.name, &whole, 6, &mut random).iter().sum::<usize>();
        tested += 1;
    }
    assert!(tested > 70 && failed > 250, "{tested} scans, {failed} failures");
}
