//! What a file is that is not what its name says, told from its first bytes: one of a registered
//! format, or of one that is known by name alone.

use std::io::Read;
use std::path::Path;

use super::origin::open_plain;
use crate::error::listed;
use crate::stage::{Format, Formats, foreign};
use crate::{Error, Result};

/// First bytes that are looked at.
pub const BYTES: usize = 512;

/// What a file is that is of no registered format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sniffed {
    /// Nothing is in it.
    Empty,
    /// A Git LFS pointer.
    Pointer,
    /// Another format, with its article.
    Other(&'static str),
    /// Something packed, with its article.
    Packed(&'static str),
    /// Text of numbers.
    Numbers,
    /// Nothing that is known.
    Unknown,
}

/// First bytes of formats, each as their own specification has them.
const MAGIC: [(&[u8], Sniffed); 29] = [
    (b"version https://git-lfs", Sniffed::Pointer),
    (b"~V", Sniffed::Other("a well log (CWLS LAS, which shares the extension)")),
    (b"~v", Sniffed::Other("a well log (CWLS LAS, which shares the extension)")),
    (b"ASTM-E57", Sniffed::Other("an E57 file")),
    (b"# .PCD", Sniffed::Other("a PCD file")),
    (b"VERSION .7", Sniffed::Other("a PCD file")),
    (b"pnts", Sniffed::Other("a 3D tile of points")),
    (b"DRACO", Sniffed::Other("a Draco file")),
    (b"glTF", Sniffed::Other("a glTF file")),
    (b"OFF\n", Sniffed::Other("an OFF file")),
    (b"OFF\r", Sniffed::Other("an OFF file")),
    (b"solid ", Sniffed::Other("an STL file")),
    (b"\x89HDF\r\n", Sniffed::Other("an HDF5 file")),
    (b"PAR1", Sniffed::Other("a Parquet file")),
    (b"SQLite format 3", Sniffed::Other("an SQLite database")),
    (b"II*\0", Sniffed::Other("a TIFF image")),
    (b"MM\0*", Sniffed::Other("a TIFF image")),
    (b"\x89PNG", Sniffed::Other("a PNG image")),
    (b"\xff\xd8\xff", Sniffed::Other("a JPEG image")),
    (b"%PDF", Sniffed::Other("a PDF document")),
    (b"<?xml", Sniffed::Other("an XML document")),
    (b"PK\x03\x04", Sniffed::Packed("a ZIP archive")),
    (b"\x1f\x8b", Sniffed::Packed("a gzip file")),
    (b"BZh", Sniffed::Packed("a bzip2 file")),
    (b"\xfd7zXZ", Sniffed::Packed("an xz file")),
    (b"7z\xbc\xaf\x27\x1c", Sniffed::Packed("a 7z archive")),
    (b"\x28\xb5\x2f\xfd", Sniffed::Packed("a Zstandard file")),
    (b"Rar!", Sniffed::Packed("a RAR archive")),
    (b"\x04\x22\x4d\x18", Sniffed::Packed("an LZ4 file")),
];

impl Sniffed {
    fn of(first: &[u8]) -> Sniffed {
        if first.is_empty() {
            return Sniffed::Empty;
        }
        if let Some((_, found)) = MAGIC.iter().find(|(magic, _)| first.starts_with(magic)) {
            return *found;
        }
        let Some(text) = text(first) else { return Sniffed::Unknown };
        // Comments stand in front of a well log's first section.
        let is_comment = |line: &&str| line.starts_with('#') || line.trim().is_empty();
        let mut lines = text.lines().skip_while(is_comment);
        let line = lines.next().unwrap_or_default().trim_start_matches('\u{feff}').trim_start();
        let word = line.get(..9).unwrap_or(line).to_ascii_lowercase();
        if line.starts_with("~V") {
            Sniffed::Other("a well log (CWLS LAS, which shares the extension)")
        } else if word.starts_with("<!doctype") || word.starts_with("<html") {
            Sniffed::Other("a web page")
        } else if line.starts_with(['{', '[']) {
            Sniffed::Other("JSON text")
        } else if is_numbers(line) {
            Sniffed::Numbers
        } else {
            Sniffed::Unknown
        }
    }

    fn name(self) -> &'static str {
        match self {
            Sniffed::Empty => "an empty file",
            Sniffed::Pointer => "a Git LFS pointer, a short text in the place of the file",
            Sniffed::Other(name) | Sniffed::Packed(name) => name,
            Sniffed::Numbers => "a text of numbers",
            Sniffed::Unknown => "of no format that is known here",
        }
    }

    fn remedy(self, formats: &Formats) -> String {
        let read = || listed(upper(formats), "and") + " are read";
        match self {
            Sniffed::Empty => {
                "what should have written it failed: make or copy it again".to_owned()
            }
            Sniffed::Pointer => "fetch the file itself with `git lfs pull`".to_owned(),
            Sniffed::Packed(_) => "unpack it first".to_owned(),
            Sniffed::Other("a web page" | "JSON text" | "an XML document") => {
                "a server sent this instead of the file: fetch it again".to_owned()
            }
            Sniffed::Other(_) | Sniffed::Numbers => {
                read() + ": convert it to one of them with another program first"
            }
            Sniffed::Unknown => read() + "; the file may be damaged",
        }
    }
}

/// `first` as text, without a character that the end of the stretch cut.
fn text(first: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(first) {
        Ok(text) => text,
        Err(e) if first.len() - e.valid_up_to() < 4 => {
            std::str::from_utf8(&first[..e.valid_up_to()]).ok()?
        }
        Err(_) => return None,
    };
    let control = |c: char| c.is_control() && !"\t\n\r".contains(c);
    (!text.contains(control)).then_some(text)
}

/// True for three numbers or more.
fn is_numbers(line: &str) -> bool {
    let separators = |c: char| c.is_whitespace() || c == ',' || c == ';';
    let words = || line.split(separators).filter(|word| !word.is_empty());
    words().count() >= 3 && words().all(|word| word.parse::<f64>().is_ok())
}

/// The first bytes of a file, as many as tell what it is.
pub fn first_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut first = Vec::new();
    let (file, _) = open_plain(path)?;
    file.take(BYTES as u64).read_to_end(&mut first).map_err(|e| Error::io(path, "read it", e))?;
    Ok(first)
}

/// The error of the file at `path`, which begins with `first` and was to be `wanted`.
pub fn not(wanted: &str, path: &Path, first: &[u8], formats: &Formats) -> Error {
    let registered = formats.sniffed(first).filter(|format| format.called() != wanted);
    let found = Some(Sniffed::of(first)).filter(|found| found.name() != wanted);
    match (registered, found.unwrap_or(Sniffed::Unknown)) {
        (Some(format), _) => {
            Error::data(path, format!("this is {}, not {wanted}", format.called()))
                .at_byte(0)
                .help(name_it(&**format, formats))
        }
        (None, Sniffed::Unknown) => foreign(path, wanted).help(Sniffed::Unknown.remedy(formats)),
        (None, found) => Error::data(path, format!("this is {}, not {wanted}", found.name()))
            .at_byte(0)
            .help(found.remedy(formats)),
    }
}

/// How a file is named so that it is read as one of the family of `format`.
fn name_it(format: &dyn Format, formats: &Formats) -> String {
    let family = formats.of_family(format.family()).filter(|f| f.arranged().is_none());
    let family: Vec<_> = family.collect();
    let dotted = listed(family.iter().map(|f| format!(".{}", f.extension())), "or");
    let first = family.first().map_or(format.name(), |first| first.name());
    format!("name it {dotted}, or give `read.format = \"{first}\"`")
}

/// The error of files that could not be opened as those of `format`: of one that does not begin as
/// such, what it is.
pub fn told(error: Error, format: &dyn Format, formats: &Formats) -> Error {
    let called = format.called();
    let is_foreign = |path: &&Path| error.to_string() == foreign(path, called).to_string();
    let first = error.path().filter(is_foreign).and_then(|path| first_bytes(path).ok());
    match (first, error.path()) {
        (Some(first), Some(path)) => not(called, path, &first, formats),
        _ => error,
    }
}

/// The names of the formats in capitals.
pub fn upper(formats: &Formats) -> impl Iterator<Item = String> {
    formats.names().into_iter().map(str::to_uppercase)
}

/// What files with this extension are, in lower case, if it is a format of points or meshes that is
/// neither read nor written.
pub fn of_extension(extension: &str) -> Option<&'static str> {
    Some(match extension {
        "neu" => "a text of numbers",
        "zlas" => "Esri's zLAS",
        "rcp" | "rcs" => "Autodesk ReCap",
        "fls" | "lsproj" => "FARO",
        "rxp" | "rdbx" => "RIEGL",
        "drc" => "Draco",
        "glb" | "gltf" => "glTF",
        "pnts" => "3D Tiles",
        "zip" | "gz" | "7z" | "bz2" | "xz" | "zst" | "tar" => "a packed file",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::las::{LAS, LAZ};
    use crate::io::ply::PLY;

    #[test]
    fn files_are_called_what_they_are() {
        let formats = Formats::default().with(LAS).with(LAZ).with(PLY);
        let told = |first: &[u8]| {
            let error = not("a LAS or LAZ file", Path::new("x"), first, &formats);
            format!("{error}; {}", error.remedy().unwrap())
        };
        for (first, what, remedy) in [
            (&b""[..], "an empty file", "make or copy it again"),
            (b"version https://git-lfs.github.com/spec/v1\noid", "Git LFS pointer", "lfs pull"),
            (b"~Version Information\nVERS. 2.0", "a well log", "another program"),
            (b"# from a rig\n#\n~VERSION\n", "a well log", "another program"),
            (b"ply\nformat ascii 1.0\n", "a PLY file", "read.format = \"ply\""),
            (b"ASTM-E57\x01\0\0\0", "an E57 file", "another program"),
            (b"# .PCD v0.7 - Point Cloud", "a PCD file", "another program"),
            (b"PK\x03\x04\x14\0", "a ZIP archive", "unpack"),
            (b"\x1f\x8b\x08", "a gzip file", "unpack"),
            (b"<!DOCTYPE html>\n<html>", "a web page", "fetch it again"),
            (b"{\"error\": 404}", "JSON text", "fetch it again"),
            (b"100.5 200.25 3.5\n", "text of numbers", "another program"),
            (b"\x00\x01\x02\x03", "by its first bytes", "may be damaged"),
        ] {
            let told = told(first);
            assert!(told.contains(what) && told.contains(remedy), "{told}");
        }
        let las = not("a PLY file", Path::new("x"), b"LASF\0", &formats);
        assert!(las.to_string().contains("a LAS or LAZ"));
    }

    #[test]
    fn a_character_cut_at_the_end_of_what_is_looked_at_leaves_the_text_a_text() {
        let numbers = "1 2 3\nä".as_bytes();
        assert_eq!(Sniffed::of(&numbers[..numbers.len() - 1]), Sniffed::Numbers);
        assert_eq!(Sniffed::of(b"1 2 3\x80\x80\x80\x80\x80 4"), Sniffed::Unknown);
    }
}
