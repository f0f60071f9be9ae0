//! Reference systems: in the form that the output wants, and compared by what they mean.

use std::path::Path;

use crate::support::case_file;
use crate::support::command::{done, fails, info, pointmill};

/// A folder with copies of these files of `tests/cases`.
fn inputs(names: &[&str]) -> tempfile::TempDir {
    let at = tempfile::tempdir().unwrap();
    for name in names {
        std::fs::copy(case_file(name), at.path().join(name)).unwrap();
    }
    at
}

fn crs(at: &Path, scan: &str) -> String {
    info(at, scan)["crs"].as_str().unwrap().to_owned()
}

fn count(at: &Path, scan: &str, record: u16) -> usize {
    let all = info(at, scan)["vlrs"].as_array().unwrap().clone();
    all.iter().filter(|vlr| vlr["record_id"] == record).count()
}

/// Fails unless the rules about reference systems hold in the file.
fn holds(at: &Path, scan: &str) {
    let (_, told, _) = pointmill(at, &["validate", "--json", scan]);
    assert!(told.contains("\"findings\""), "{told}");
    for rule in ["crs-kind", "wkt-bit", "wkt-text", "wkt-end", "geotiff-keys"] {
        assert!(!told.contains(&format!("\"name\": \"{rule}\"")), "{scan}: {told}");
    }
}

#[test]
fn keys_become_wkt_where_the_output_asks_for_it() {
    let at = inputs(&["121-geokey.las", "100e-geokey.las"]);
    let at = at.path();
    for (from, to) in [
        (&["121-geokey.las"][..], "o.copc.laz"),
        (&["121-geokey.las", "--point-format", "6"], "six.las"),
        (&["100e-geokey.las"], "same.laz"),
    ] {
        done(at, &[&["convert"], from, &["-o", to, "--quiet"]].concat());
        let text = crs(at, to);
        let is_compound = text.starts_with("COMPD_CS");
        assert_eq!(is_compound, from[0] == "121-geokey.las", "{text}");
        assert!(text.contains("AUTHORITY[\"EPSG\",\"25832\"]]"), "{text}");
        assert_eq!(text.contains("AUTHORITY[\"EPSG\",\"7837\"]]"), is_compound);
        assert_eq!((count(at, to, 2112), count(at, to, 34735)), (1, 0), "{to}");
        holds(at, to);
    }
    // Point formats 0 to 5 keep what there is.
    done(at, &["convert", "121-geokey.las", "-o", "one.laz", "--quiet"]);
    assert_eq!(crs(at, "one.laz"), "EPSG:25832+7837");
    holds(at, "one.laz");
}

#[test]
fn a_code_of_a_user_or_of_ply_becomes_wkt_or_keys() {
    let at = inputs(&["121-geokey.las", "100a-nocrs.las"]);
    let at = at.path();
    done(at, &["convert", "121-geokey.las", "-o", "o.ply", "--quiet"]);
    let scale = ["--scale", "0.01", "--quiet"];
    done(at, &[&["convert", "o.ply", "-o", "one.las"], &scale[..]].concat());
    assert_eq!(crs(at, "one.las"), "EPSG:25832+7837");
    done(at, &[&["convert", "o.ply", "-o", "o.copc.laz"], &scale[..]].concat());
    assert!(crs(at, "o.copc.laz").starts_with("COMPD_CS[\""));
    // The code of a compound system is that of its parts.
    let given = ["convert", "100a-nocrs.las", "-o", "c.las", "--crs", "epsg:5555", "--quiet"];
    done(at, &given);
    let text = crs(at, "c.las");
    assert!(text.contains("\"25832\"]]") && text.contains("\"5783\"]]"), "{text}");
    for scan in ["one.las", "o.copc.laz", "c.las"] {
        holds(at, scan);
    }
    // Three axes have no WKT 1: the keys stay, and that is said.
    let given = ["convert", "100a-nocrs.las", "-o", "d.las", "--crs", "EPSG:4979"];
    let (_, _, told) = pointmill(at, &given);
    assert!(told.contains("EPSG:4979") && told.contains("asks for WKT"), "{told}");
    assert_eq!(crs(at, "d.las"), "EPSG:4979");
    let wrong = ["convert", "100a-nocrs.las", "-o", "e.las", "--crs", "EPSG:4979+7837"];
    fails(at, &wrong, 2, &["--crs", "heights of its own"]);
}

/// EPSG:25832 as ESRI has it, and as WKT 2.
const ESRI: &str = "PROJCS[\"ETRS_1989_UTM_Zone_32N\",GEOGCS[\"GCS_ETRS_1989\",\
    DATUM[\"D_ETRS_1989\",SPHEROID[\"GRS_1980\",6378137.0,298.257222101]],\
    PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],\
    PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],\
    PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Central_Meridian\",9.0],\
    PARAMETER[\"Scale_Factor\",0.9996],PARAMETER[\"Latitude_Of_Origin\",0.0],\
    UNIT[\"Meter\",1.0]]";

#[test]
fn files_of_one_system_in_other_spellings_merge_and_others_do_not() {
    let at = inputs(&["100a-nocrs.las", "100b-wkt.las", "12-wkt2-4224-liblas.las"]);
    let at = at.path();
    let spelled = |name: &str, text: &str| {
        done(at, &["convert", "100a-nocrs.las", "-o", name, "--crs", text, "--quiet"]);
    };
    spelled("esri.las", ESRI);
    spelled("code.las", "EPSG:25832");
    spelled("other.las", &ESRI.replace("Meridian\",9.0", "Meridian\",9.5"));
    let merged = |inputs: &[&str]| {
        done(at, &[&["convert"], inputs, &["-o", "o.las", "--quiet"]].concat());
        crs(at, "o.las")
    };
    let all = ["100b-wkt.las", "esri.las", "code.las"];
    for (n, one) in all.iter().enumerate() {
        for two in &all[n + 1..] {
            assert!(merged(&[one, two]) == merged(&[two, one]), "{one} {two}");
        }
    }
    // A projection without its numbers is known by its code, and by nothing else.
    let wkt2 = "12-wkt2-4224-liblas.las";
    merged(&[wkt2, "code.las"]);
    fails(at, &["convert", wkt2, "esri.las", "-o", "o.las"], 1, &["CRS differ", "--crs"]);
    let told = ["other.las", "--crs", "`--reproject` does it"];
    fails(at, &["convert", "esri.las", "other.las", "-o", "o.las"], 1, &told);
}

#[test]
fn keys_of_other_units_are_other_systems_and_a_conversion_is_of_that_of_its_input() {
    let name = "15c-geokeys-epsg-only-2277-5703.las";
    let at = inputs(&[name]);
    let at = at.path();
    let bytes = std::fs::read(at.join(name)).unwrap();
    let words = |all: &[u16]| all.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let heights = words(&[4096, 0, 1, 5703]);
    let place = bytes.windows(8).position(|window| window == heights).unwrap();
    for (scan, key, value) in
        [("feet.las", 4099, 9003), ("metres.las", 4099, 9001), ("across.las", 3076, 9001)]
    {
        let mut other = bytes.clone();
        other[place..place + 8].copy_from_slice(&words(&[key, 0, 1, value]));
        std::fs::write(at.join(scan), other).unwrap();
    }
    for other in ["metres.las", "across.las", name] {
        let told = ["CRS differ", "--crs"];
        fails(at, &["convert", "feet.las", other, "-o", "no.las"], 1, &told);
    }
    done(at, &["convert", "feet.las", "-o", "seven.las", "--point-format", "7", "--quiet"]);
    let both = ["seven.las", "feet.las", "-o", "both.las", "--point-format", "7", "--quiet"];
    done(at, &[&["convert"], &both[..]].concat());
    assert_eq!(crs(at, "seven.las"), crs(at, "feet.las"));
    done(at, &["convert", "feet.las", "-o", "o.ply", "--quiet"]);
    done(at, &["convert", "o.ply", "-o", "back.las", "--scale", "0.01", "--quiet"]);
    assert_eq!(crs(at, "back.las"), crs(at, "feet.las"), "PLY says it, too");
}
