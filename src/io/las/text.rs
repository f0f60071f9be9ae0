//! Texts in fields of a fixed length.

/// A text field: its bytes up to the first zero, those that are no UTF-8 replaced.
pub fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim_end().to_owned()
}

/// `text` cut to at most `room` bytes at a character, and the rest.
pub fn split_at_room(text: &str, room: usize) -> (&str, &str) {
    let fits = |&end: &usize| text.is_char_boundary(end);
    text.split_at((0..=room.min(text.len())).rev().find(fits).unwrap_or(0))
}

/// A field of `N` bytes that holds `text`, or as much of it as fits.
pub fn field<const N: usize>(text: &str) -> [u8; N] {
    let (text, _) = split_at_room(text, N);
    let mut field = [0; N];
    field[..text.len()].copy_from_slice(text.as_bytes());
    field
}
