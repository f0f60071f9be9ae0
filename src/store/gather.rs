//! Records from here and there, one after the other. Knows lengths alone.
//!
//! The sort orders indices and leaves records where they are, since a swap of long records would
//! copy them many times. They are copied once, here, with lengths that the compiler knows for the
//! usual formats.

/// Appends to `out` the records of `stride` bytes that `indices` name among `records`.
///
/// Strides of the usual formats are constants to the compiler: a call for each copy would cost more
/// than the copy.
pub(crate) fn gather(
    records: &[u8],
    stride: usize,
    indices: impl ExactSizeIterator<Item = usize>,
    out: &mut Vec<u8>,
) {
    let start = out.len();
    out.resize(start + indices.len() * stride, 0);
    let out = &mut out[start..];
    match stride {
        12 => gather_of::<12>(records, indices, out),
        15 => gather_of::<15>(records, indices, out),
        20 => gather_of::<20>(records, indices, out),
        24 => gather_of::<24>(records, indices, out),
        26 => gather_of::<26>(records, indices, out),
        27 => gather_of::<27>(records, indices, out),
        28 => gather_of::<28>(records, indices, out),
        30 => gather_of::<30>(records, indices, out),
        34 => gather_of::<34>(records, indices, out),
        36 => gather_of::<36>(records, indices, out),
        38 => gather_of::<38>(records, indices, out),
        0 => {}
        _ => {
            for (i, place) in indices.zip(out.chunks_exact_mut(stride)) {
                place.copy_from_slice(&records[i * stride..(i + 1) * stride]);
            }
        }
    }
}

fn gather_of<const N: usize>(records: &[u8], indices: impl Iterator<Item = usize>, out: &mut [u8]) {
    let (records, _) = records.as_chunks::<N>();
    let (places, _) = out.as_chunks_mut::<N>();
    for (i, place) in indices.zip(places) {
        *place = records[i];
    }
}

#[cfg(test)]
mod tests {
    use crate::store::gather::gather;

    #[test]
    fn records_of_any_stride_are_gathered() {
        for stride in 0..70 {
            let records: Vec<u8> = (0..9 * stride).map(|i| (i * 7 % 251) as u8).collect();
            let mut out = vec![1, 2, 3];
            gather(&records, stride, [8usize, 0, 3, 3].into_iter(), &mut out);
            let expected = [8, 0, 3, 3].iter().flat_map(|i| &records[i * stride..][..stride]);
            assert_eq!(out[..3], [1, 2, 3]);
            assert!(out[3..].iter().eq(expected), "{stride}");
        }
    }
}
