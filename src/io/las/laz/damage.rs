//! What is wrong with compressed points.

use super::coder::Coder;
use crate::Error;

/// What is wrong with a stream of compressed points, and where that was seen. What is damaged may
/// lie before it.
#[derive(Debug)]
pub struct Damage {
    /// What is wrong.
    pub why: Why,
    /// File position up to which it was read.
    pub byte: u64,
    /// The layer, where there are layers.
    pub layer: Option<&'static str>,
}

/// What is wrong with a stream.
#[derive(Debug)]
pub enum Why {
    /// Its bytes end before its points.
    Short,
    /// Its points end before its bytes.
    Long,
    /// Nothing that an encoder writes.
    Wrong,
    /// It could not be read at all.
    Unread(Error),
}

impl Damage {
    /// What the decoder has seen so far.
    pub fn of(coder: &mut Coder, layer: Option<&'static str>) -> Result<(), Damage> {
        let byte = coder.bytes().position();
        let damage = |why| Err(Damage { why, byte, layer });
        if let Err(error) = coder.bytes().failed() {
            return damage(Why::Unread(error));
        }
        if coder.bytes().is_beyond() {
            return Err(Damage { why: Why::Short, byte: coder.bytes().end(), layer });
        }
        if coder.is_wrong() { damage(Why::Wrong) } else { Ok(()) }
    }

    /// What is wrong with a stream whose points were all read.
    pub fn at_end(coder: &mut Coder, layer: Option<&'static str>) -> Result<(), Damage> {
        let (byte, end) = (coder.bytes().position(), coder.bytes().end());
        if byte != end {
            return Err(Damage { why: Why::Long, byte, layer });
        }
        Damage::at_pause(coder, layer)
    }

    /// What is wrong with a stream that an encoder ended here.
    pub fn at_pause(coder: &mut Coder, layer: Option<&'static str>) -> Result<(), Damage> {
        let byte = coder.bytes().position();
        if coder.is_end() { Ok(()) } else { Err(Damage { why: Why::Wrong, byte, layer }) }
    }
}
