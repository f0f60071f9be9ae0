//! The SHA-256 of files, by which anybody can tell whether a file is the one that was read.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// Bytes that are read at once.
const PIECE: usize = 64 << 10;
/// Hexadecimal digits of a hash.
const DIGITS: usize = 64;

/// How long a file is, and its SHA-256 in hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileHash {
    /// Its length.
    pub bytes: u64,
    /// 64 digits, letters in lower case; of a draft all are 0.
    pub sha256: String,
}

impl FileHash {
    /// What stands in the place of a hash that is not known yet.
    pub fn draft(bytes: u64) -> Self {
        FileHash { bytes, sha256: "0".repeat(DIGITS) }
    }

    /// That of the file at `path`, which is read to its end. `go_on` is asked before each piece.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, and what `go_on` says.
    pub fn of(path: &Path, mut go_on: impl FnMut() -> Result<()>) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, "open it", e))?;
        let mut hashing = HashingFile::new(file);
        let mut piece = Vec::new();
        while hashing.piece(path, &mut piece)? > 0 {
            go_on()?;
        }
        Ok(hashing.finish())
    }
}

/// A file that is being hashed.
pub struct HashingFile {
    file: File,
    hasher: Sha256,
    bytes: u64,
}

impl HashingFile {
    /// A file from its beginning.
    pub fn new(file: File) -> Self {
        HashingFile { file, hasher: Sha256::new(), bytes: 0 }
    }

    /// Hashes the next piece; the bytes that it has, 0 at the end. `piece` is room for it.
    ///
    /// # Errors
    ///
    /// What the system refuses to read; `path` is the file's.
    pub fn piece(&mut self, path: &Path, piece: &mut Vec<u8>) -> Result<usize> {
        piece.resize(PIECE, 0);
        loop {
            match self.file.read(piece) {
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                read => {
                    let read =
                        read.map_err(|e| Error::io(path, "read it", e).at_byte(self.bytes))?;
                    self.hasher.update(&piece[..read]);
                    self.bytes += read as u64;
                    return Ok(read);
                }
            }
        }
    }

    /// The hash of what was read.
    pub fn finish(self) -> FileHash {
        let digits = |byte: &u8| [byte >> 4, byte & 15];
        let digit = |half: u8| char::from(b"0123456789abcdef"[usize::from(half)]);
        let sha256 = self.hasher.finalize().iter().flat_map(digits).map(digit).collect();
        FileHash { bytes: self.bytes, sha256 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_standard() {
        let at = tempfile::NamedTempFile::new().unwrap();
        let hash = |bytes: &[u8]| {
            std::fs::write(at.path(), bytes).unwrap();
            FileHash::of(at.path(), || Ok(())).unwrap()
        };
        // FIPS 180-4, the examples of NIST: no byte, 3 bytes, a million.
        let empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let million = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";
        let of = |bytes, sha256: &str| FileHash { bytes, sha256: sha256.to_owned() };
        assert_eq!(hash(b""), of(0, empty));
        assert_eq!(hash(b"abc"), of(3, abc));
        assert_eq!(hash(&[b'a'; 1_000_000]), of(1_000_000, million));
        assert_eq!(FileHash::draft(3).sha256.len(), abc.len());
    }

    #[test]
    fn hashing_can_be_given_up() {
        let at = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(at.path(), [0; 3 * PIECE]).unwrap();
        let mut asked = 0;
        let given_up = FileHash::of(at.path(), || {
            asked += 1;
            if asked < 2 { Ok(()) } else { Err(Error::interrupted()) }
        });
        assert!(given_up.is_err());
        assert_eq!(asked, 2);
    }
}
