//! The header that a PLY file is written with, and that is of one length whatever the count of
//! vertices.

use std::collections::BTreeMap;

use super::faces;
use super::header::{Element, Property, PropertyKind, word};
use super::names;
use super::source::{PlyNative, Rest};
use crate::io::rows::Encoding;
use crate::io::rows::comments::{line, lines, made};
use crate::io::rows::noted::NotedLines;
use crate::point::{Metadata, Schema, names as point_names};

/// The header, but for the count of vertices.
#[derive(Clone)]
pub(super) struct Headings {
    /// To the end of what comments say of the coordinates and times, which the comment of [`made`]
    /// ends.
    start: String,
    /// How the file was made.
    pub note: NotedLines,
    comments: String,
    /// Elements before the vertices.
    before: String,
    vertex: Element,
    /// True if triangles stand behind the vertices.
    pub has_faces: bool,
    /// How many there are so far.
    pub faces: u64,
    after: String,
}

impl Headings {
    /// The header of `vertex` records: with what `native` has beside them and the elements of
    /// `rest` around them.
    pub fn of(
        vertex: &Schema,
        encoding: Encoding,
        metadata: &Metadata,
        native: Option<&PlyNative>,
        rest: Option<&PlyNative>,
    ) -> Headings {
        let dimensions: Vec<&str> = vertex.dimensions.iter().map(|d| d.name.as_str()).collect();
        let kept = native.iter().flat_map(|native| &native.properties);
        let kept: BTreeMap<&str, &String> = kept.map(|(d, p)| (d.as_str(), p)).collect();
        let properties = names::properties(&dimensions, |name| kept.get(name).copied().cloned());
        let mut start = format!("ply\nformat {} 1.0\n", word(encoding));
        start += &lines("comment ", metadata, dimensions.contains(&point_names::GPS_TIME));
        let mut comments: String = properties
            .iter()
            .zip(&dimensions)
            .filter_map(|(property, dimension)| names::comment(property, dimension))
            .map(|comment| line("comment ", &comment))
            .collect();
        comments.extend(metadata.comments.iter().map(|comment| line("comment ", comment)));
        comments
            .extend(native.iter().flat_map(|n| &n.obj_info).map(|info| line("obj_info ", info)));
        let of = |elements: &[Element]| elements.iter().map(Element::lines).collect::<String>();
        let rest: Option<&Rest> = rest.and_then(|native| native.rest.as_ref());
        let properties = properties
            .into_iter()
            .zip(&vertex.dimensions)
            .map(|(name, d)| Property { name, kind: PropertyKind::Scalar(d.scalar) })
            .collect();
        Headings {
            before: rest.map(|r| of(&r.before)).unwrap_or_default(),
            after: rest.map(|r| of(&r.after)).unwrap_or_default(),
            vertex: Element { name: "vertex".into(), count: 0, properties },
            has_faces: false,
            faces: 0,
            start,
            note: NotedLines::default(),
            comments,
        }
    }

    /// Always of one length: blanks behind a comment take what the counts leave.
    pub fn text(&self, points: u64) -> String {
        let triangles = self.faces;
        let vertex = Element { count: points, ..self.vertex.clone() };
        let Headings { start, note, comments, before, after, .. } = self;
        let (vertex, counts) = (vertex.lines(), [points, triangles]);
        let faces = if self.has_faces { faces::lines(triangles) } else { String::new() };
        let made = made(if self.has_faces { &counts } else { &counts[..1] });
        let elements = format!("{before}{vertex}{faces}{after}");
        let note = &note.text;
        format!("{start}comment {made}\n{note}{comments}{elements}end_header\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_has_one_length_for_every_count() {
        let vertex = Element { name: "vertex".into(), count: 0, properties: Vec::new() };
        let header = Headings {
            start: "ply\n".into(),
            note: NotedLines::default(),
            comments: String::new(),
            before: String::new(),
            vertex,
            has_faces: false,
            faces: 0,
            after: String::new(),
        };
        let length = header.text(0).len();
        let counts = [1, 9, 10, 12_345, u64::MAX];
        assert!(counts.iter().all(|&n| header.text(n).len() == length));
        assert!(header.text(u64::MAX).contains("comment made by pointmill\n"));
        assert!(!header.text(7).contains('.'));
        let header = |faces| Headings { has_faces: true, faces, ..header.clone() };
        let length = header(0).text(0).len();
        assert!(counts.iter().all(|&n| header(3).text(n).len() == length));
        assert!(counts.iter().all(|&n| header(n).text(3).len() == length));
    }
}
