//! Meshes as files have them.

use std::fs;
use std::path::Path;

/// The corners of a mesh, and its triangles by their numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshRead {
    pub vertices: Vec<[f64; 3]>,
    pub faces: Vec<[usize; 3]>,
}

fn count(header: &str, element: &str) -> usize {
    let line = header.lines().find_map(|line| line.strip_prefix(&format!("element {element} ")));
    line.unwrap_or_else(|| panic!("no {element} in {header}")).parse().unwrap()
}

/// Bytes of a vertex, by the header.
fn stride(header: &str) -> usize {
    let (vertex, _) = header.split_once("element face").unwrap();
    let types = vertex.lines().filter_map(|line| line.strip_prefix("property "));
    let size = |property: &str| match property.split(' ').next().unwrap() {
        "double" => 8,
        "float" | "int" | "uint" => 4,
        "short" | "ushort" => 2,
        _ => 1,
    };
    types.map(size).sum()
}

/// Reads a PLY file whose vertices begin with three doubles.
pub fn read_ply(path: &Path) -> MeshRead {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    let stride = stride(header);
    let (points, faces) = (count(header, "vertex"), count(header, "face"));
    let (vertices, rest) = bytes[body..].split_at(points * stride);
    let number = |at: &[u8]| f64::from_le_bytes(at.try_into().unwrap());
    let vertices = vertices.chunks_exact(stride);
    let vertices = vertices.map(|v| [0, 8, 16].map(|at| number(&v[at..at + 8]))).collect();
    assert_eq!(rest.len(), faces * 13, "a face is a count and three numbers");
    let faces = rest.chunks_exact(13).map(|face| {
        assert_eq!(face[0], 3);
        let corner = |at: usize| i32::from_le_bytes(face[at..at + 4].try_into().unwrap());
        [1, 5, 9].map(|at| usize::try_from(corner(at)).unwrap())
    });
    MeshRead { vertices, faces: faces.collect() }
}

/// Reads an ascii PLY file whose vertices begin with their places.
pub fn read_ascii_ply(path: &Path) -> MeshRead {
    let text = fs::read_to_string(path).unwrap();
    let (header, body) = text.split_once("end_header\n").unwrap();
    let (points, faces) = (count(header, "vertex"), count(header, "face"));
    let lines: Vec<Vec<&str>> = body.lines().map(|l| l.split(' ').collect()).collect();
    assert_eq!(lines.len(), points + faces);
    let vertices = lines[..points].iter().map(|l| [0, 1, 2].map(|n| l[n].parse().unwrap()));
    let faces = lines[points..].iter().map(|l| {
        assert_eq!((l.len(), l[0]), (4, "3"));
        [1, 2, 3].map(|n| l[n].parse().unwrap())
    });
    MeshRead { vertices: vertices.collect(), faces: faces.collect() }
}

/// Reads an OBJ file.
pub fn read_obj(path: &Path) -> MeshRead {
    let text = fs::read_to_string(path).unwrap();
    let mut mesh = MeshRead { vertices: Vec::new(), faces: Vec::new() };
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["v", x, y, z] => mesh.vertices.push([x, y, z].map(|v| v.parse().unwrap())),
            ["f", a, b, c] => {
                mesh.faces.push([a, b, c].map(|n| n.parse::<usize>().unwrap() - 1));
            }
            _ => assert!(line.starts_with('#'), "{line}"),
        }
    }
    mesh
}

/// Normal and corners of each triangle of a binary STL file.
pub fn read_stl(path: &Path) -> Vec<[[f32; 3]; 4]> {
    let bytes = fs::read(path).unwrap();
    assert!(!bytes.starts_with(b"solid"));
    let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) as usize;
    assert_eq!(bytes.len(), 84 + 50 * count);
    let triangle = |t: &[u8]| {
        let number = |n: usize| f32::from_le_bytes(t[4 * n..4 * n + 4].try_into().unwrap());
        [0, 3, 6, 9].map(|first| [0, 1, 2].map(|n| number(first + n)))
    };
    bytes[84..].chunks_exact(50).map(triangle).collect()
}
