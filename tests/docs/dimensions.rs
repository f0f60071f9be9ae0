//! docs/dimensions.md: what the dimensions that formats share are called and held in, format by
//! format, from the tables that the formats themselves go by.

use std::fmt::Write as _;

use pointmill::internals::las::layout;
use pointmill::internals::shared_names;
use pointmill::point::{Dimension, Scalar};

use super::{SAYS_SO, keep};

/// A type in the words of the page.
fn word(field: &Dimension) -> String {
    let kind = match (field.bits, field.scalar) {
        (Some(bits), _) if bits.width == 1 => "1 bit".to_owned(),
        (Some(bits), _) => format!("{} bits", bits.width),
        (None, Scalar::U8) => "u8".to_owned(),
        (None, Scalar::I8) => "i8".to_owned(),
        (None, Scalar::U16) => "u16".to_owned(),
        (None, Scalar::I16) => "i16".to_owned(),
        (None, Scalar::U32) => "u32".to_owned(),
        (None, Scalar::I32) => "i32".to_owned(),
        (None, Scalar::U64) => "u64".to_owned(),
        (None, Scalar::I64) => "i64".to_owned(),
        (None, Scalar::F32) => "f32".to_owned(),
        (None, Scalar::F64) => "f64".to_owned(),
    };
    let steps = ["X", "Y", "Z"].contains(&field.name.as_str());
    match field.scale {
        _ if steps => format!("{kind}, steps of the header's scale"),
        1.0 => kind,
        scale => format!("{kind}, steps of {scale}"),
    }
}

/// In which point formats of LAS a dimension is held in what.
fn in_las(name: &str) -> String {
    let of = |format: u8| layout(format, &[], [1.0; 3], [0.0; 3]).find(name).map(word);
    let mut runs: Vec<(u8, u8, String)> = Vec::new();
    for format in 0..=10 {
        let Some(kind) = of(format) else { continue };
        match runs.last_mut().filter(|(_, last, known)| *last + 1 == format && *known == kind) {
            Some((_, last, _)) => *last = format,
            None => runs.push((format, format, kind)),
        }
    }
    let all = matches!(runs[..], [(0, 10, _)]);
    let told = |(first, last, kind): &(u8, u8, String)| match first == last {
        _ if all => kind.clone(),
        true => format!("{first}: {kind}"),
        false => format!("{first}–{last}: {kind}"),
    };
    match runs.is_empty() {
        true => "extra bytes".to_owned(),
        false => runs.iter().map(told).collect::<Vec<_>>().join("; "),
    }
}

#[test]
fn the_dimensions_that_formats_share_have_a_page() {
    let names = shared_names();
    assert!(names.len() >= 30);
    let mut page = format!(
        "# Dimensions\n\n<!-- {SAYS_SO} -->\n\n\
         A dimension of one format is the same dimension of another when its name is the same. What \n\
         each format calls it, and what LAS holds it in, by point format; PLY, PCD, E57 and texts hold \n\
         it in the type that it comes in, coordinates of whole steps as `double`, in E57 and texts as \n\
         the steps that they are. Texts call it what it is called here. Every other name is an extra \n\
         dimension: extra bytes in LAS, a property, field or column of its own elsewhere, an extension \n\
         (`pm:`) in E57. Headings, properties and fields are read in any of the spellings, headings \n\
         whatever their case, blanks and underscores; so are CloudCompare's `scalar_` and PDAL's names.\n\n\
         | dimension | what it is | LAS, by point format | PLY | PCD | E57 | also read as |\n\
         |---|---|---|---|---|---|---|\n"
    );
    for name in &names {
        let [ply, pcd, e57] = &name.written;
        let spelled: Vec<String> = name.spellings.iter().map(|s| format!("`{s}`")).collect();
        let (dimension, about, las) = (name.dimension, name.about, in_las(name.dimension));
        let spelled = spelled.join(", ");
        let _ = writeln!(
            page,
            "| `{dimension}` | {about} | {las} | `{ply}` | `{pcd}` | `{e57}` | {spelled} |"
        );
    }
    page = page.replace(" \n", "\n");
    keep("docs/dimensions.md", &page);
}
