//! LAS files laid out by hand after the specification.

/// A record beside the points of a LAS file.
#[derive(Clone)]
pub struct Beside {
    pub user: &'static str,
    pub record: u16,
    pub payload: Vec<u8>,
}

/// A LAS 1.4 file, laid out by hand (LAS 1.4 R15, tables 3, 4, 5 and 24).
pub struct LasFile<'a> {
    pub format: u8,
    pub stride: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
    pub vlrs: &'a [Beside],
    pub evlrs: &'a [Beside],
    pub records: &'a [u8],
}

impl LasFile<'_> {
    pub fn bytes(&self) -> Vec<u8> {
        let vlrs: Vec<u8> = self.vlrs.iter().flat_map(|v| beside(v, false)).collect();
        let points = (self.records.len() / self.stride) as u64;
        let start = 375 + vlrs.len();
        let mut header = vec![0u8; 375];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"LASF");
        put(4, &7u16.to_le_bytes());
        put(6, &(if self.format >= 6 { 16u16 } else { 0 }).to_le_bytes());
        put(8, &[9; 16]);
        put(24, &[1, 4]);
        put(26, b"a scanner");
        put(58, b"a program 1.0");
        put(90, &200u16.to_le_bytes());
        put(92, &2020u16.to_le_bytes());
        put(94, &375u16.to_le_bytes());
        put(96, &(start as u32).to_le_bytes());
        put(100, &(self.vlrs.len() as u32).to_le_bytes());
        put(104, &[self.format]);
        put(105, &(self.stride as u16).to_le_bytes());
        if self.format < 6 {
            put(107, &(points as u32).to_le_bytes());
        }
        for axis in 0..3 {
            put(131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(155 + 8 * axis, &self.offset[axis].to_le_bytes());
            let [lo, hi] = self.bounds(axis);
            put(179 + 16 * axis, &hi.to_le_bytes());
            put(187 + 16 * axis, &lo.to_le_bytes());
        }
        let end = (start + self.records.len()) as u64;
        put(235, &(if self.evlrs.is_empty() { 0 } else { end }).to_le_bytes());
        put(243, &(self.evlrs.len() as u32).to_le_bytes());
        put(247, &points.to_le_bytes());
        let evlrs: Vec<u8> = self.evlrs.iter().flat_map(|v| beside(v, true)).collect();
        [&header, &vlrs, self.records, &evlrs].into_iter().flatten().copied().collect()
    }
}

impl LasFile<'_> {
    /// The least and the largest coordinate of the points; 0 without points.
    fn bounds(&self, axis: usize) -> [f64; 2] {
        let stored = self
            .records
            .chunks_exact(self.stride)
            .map(|record| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap()));
        let world = |v: i32| f64::from(v) * self.scale[axis] + self.offset[axis];
        let (lo, hi) = (stored.clone().map(world), stored.map(world));
        [lo.reduce(f64::min).unwrap_or(0.0), hi.reduce(f64::max).unwrap_or(0.0)]
    }
}

fn beside(of: &Beside, extended: bool) -> Vec<u8> {
    let mut bytes = vec![0u8; 2 + 16];
    bytes[2..2 + of.user.len()].copy_from_slice(of.user.as_bytes());
    bytes.extend(of.record.to_le_bytes());
    match extended {
        true => bytes.extend((of.payload.len() as u64).to_le_bytes()),
        false => bytes.extend((of.payload.len() as u16).to_le_bytes()),
    }
    let mut description = [0u8; 32];
    description[..9].copy_from_slice(b"of a test");
    bytes.extend(description);
    bytes.extend(&of.payload);
    bytes
}

/// Bytes of a record of each point format (LAS 1.4 R15, tables 7 to 17).
pub const STRIDES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Descriptors of extra bytes (LAS 1.4 R15, table 24) and how many bytes they describe: two
/// numbers, one of them scaled, and three bytes without a meaning.
pub fn extra_bytes() -> (Beside, usize) {
    let mut payload = Vec::new();
    for (kind, options, name, scale) in [
        (3u8, 0u8, "height", 0.0f64),
        (9, 0, "amplitude", 0.0),
        (6, 8, "width", 0.001),
        (0, 3, "raw", 0.0),
    ] {
        let mut descriptor = [0u8; 192];
        descriptor[2] = kind;
        descriptor[3] = options;
        descriptor[4..4 + name.len()].copy_from_slice(name.as_bytes());
        descriptor[112..120].copy_from_slice(&scale.to_le_bytes());
        payload.extend(descriptor);
    }
    (Beside { user: "LASF_Spec", record: 4, payload }, 2 + 4 + 4 + 3)
}
