//! Triangles as the faces of a PLY file.

use crate::io::rows::{Encoding, number};
use crate::point::{Endian, Value};
use crate::report::Grouped;
use crate::stage::{EncodeTriangles, Encoded, Triangle};
use crate::{Error, Result};

/// What a header says of so many faces.
pub(super) fn lines(count: u64) -> String {
    format!("element face {count}\nproperty list uchar int vertex_indices\n")
}

/// Encodes triangles as lists of three vertices.
pub(super) struct FaceEncoder(pub Encoding);

impl EncodeTriangles for FaceEncoder {
    fn encode(&self, triangles: &[Triangle]) -> Result<Encoded> {
        let mut bytes = Vec::with_capacity(triangles.len() * (1 + 3 * size_of::<i32>()));
        for triangle in triangles {
            let mut corners = [0i32; 3];
            for (corner, number) in corners.iter_mut().zip(triangle.corners) {
                *corner = i32::try_from(number).map_err(|_| too_many(number))?;
            }
            match self.0 {
                Encoding::Ascii => {
                    bytes.push(b'3');
                    for corner in corners {
                        bytes.push(b' ');
                        number::print(Value::Signed(i64::from(corner)), &mut bytes);
                    }
                    bytes.push(b'\n');
                }
                encoding => {
                    bytes.push(3);
                    corners.into_iter().for_each(|corner| match encoding.endian() {
                        Endian::Big => bytes.extend(corner.to_be_bytes()),
                        Endian::Little => bytes.extend(corner.to_le_bytes()),
                    });
                }
            }
        }
        let triangles = triangles.len() as u64;
        Ok(Encoded { bytes, triangles, ..Encoded::default() })
    }
}

fn too_many(number: u64) -> Error {
    let most = Grouped(i32::MAX as u64);
    let told = format!(
        "a face of a PLY file refers to vertices by numbers up to {most}, and this is vertex {}",
        Grouped(number)
    );
    Error::pipeline(told).help("reduce the points further, or write OBJ")
}
