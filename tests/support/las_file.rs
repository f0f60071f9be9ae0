//! LAS files laid out by hand after the specification (LAS 1.4 R15, tables 3, 4, 5 and 24).

/// Bytes of a record of each point format (LAS 1.4 R15, tables 7 to 17).
pub const STRIDES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Bytes of the header of LAS 1.`minor`.
pub fn header_size(minor: u8) -> usize {
    [227, 227, 227, 235, 375][usize::from(minor.min(4))]
}

/// A record beside the points of a LAS file.
#[derive(Clone)]
pub struct Beside {
    pub user: &'static str,
    pub record: u16,
    pub payload: Vec<u8>,
}

impl Beside {
    /// Its bytes; extended, it stands behind the points and has a longer length.
    pub fn bytes(&self, extended: bool) -> Vec<u8> {
        let mut bytes = vec![0u8; 2 + 16];
        bytes[2..2 + self.user.len()].copy_from_slice(self.user.as_bytes());
        bytes.extend(self.record.to_le_bytes());
        match extended {
            true => bytes.extend((self.payload.len() as u64).to_le_bytes()),
            false => bytes.extend((self.payload.len() as u16).to_le_bytes()),
        }
        let mut description = [0u8; 32];
        description[..9].copy_from_slice(b"of a test");
        bytes.extend(description);
        bytes.extend(&self.payload);
        bytes
    }
}

/// What a header says.
pub struct Header {
    pub minor: u8,
    pub format: u8,
    pub is_compressed: bool,
    pub stride: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
}

impl Header {
    /// The header of a file of `records`, and `vlrs` behind it: all that is before the points.
    pub fn bytes(&self, vlrs: &[Beside], records: &[u8]) -> Vec<u8> {
        let size = header_size(self.minor);
        let behind: Vec<u8> = vlrs.iter().flat_map(|v| v.bytes(false)).collect();
        let points = (records.len() / self.stride) as u64;
        let mut header = vec![0u8; size];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"LASF");
        put(4, &7u16.to_le_bytes());
        put(6, &(if self.format >= 6 { 16u16 } else { 0 }).to_le_bytes());
        put(8, &[9; 16]);
        put(24, &[1, self.minor]);
        put(26, b"a scanner");
        put(58, b"a program 1.0");
        put(90, &200u16.to_le_bytes());
        put(92, &2020u16.to_le_bytes());
        put(94, &(size as u16).to_le_bytes());
        put(96, &((size + behind.len()) as u32).to_le_bytes());
        put(100, &(vlrs.len() as u32).to_le_bytes());
        put(104, &[self.format | if self.is_compressed { 0x80 } else { 0 }]);
        put(105, &(self.stride as u16).to_le_bytes());
        if self.format < 6 {
            put(107, &(points as u32).to_le_bytes());
        }
        for axis in 0..3 {
            put(131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(155 + 8 * axis, &self.offset[axis].to_le_bytes());
            let [lo, hi] = self.bounds(axis, records);
            put(179 + 16 * axis, &hi.to_le_bytes());
            put(187 + 16 * axis, &lo.to_le_bytes());
        }
        if self.minor >= 4 {
            put(247, &points.to_le_bytes());
        }
        header.extend(behind);
        header
    }

    /// The least and the largest coordinate of the points; 0 without points.
    fn bounds(&self, axis: usize, records: &[u8]) -> [f64; 2] {
        let stored = records
            .chunks_exact(self.stride)
            .map(|record| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap()));
        let world = |v: i32| f64::from(v) * self.scale[axis] + self.offset[axis];
        let (lo, hi) = (stored.clone().map(world), stored.map(world));
        [lo.reduce(f64::min).unwrap_or(0.0), hi.reduce(f64::max).unwrap_or(0.0)]
    }
}

/// Puts extended records behind the points of a LAS 1.4 file that ends there.
pub fn extend(file: &mut Vec<u8>, evlrs: &[Beside]) {
    if !evlrs.is_empty() {
        let end = file.len() as u64;
        file[235..243].copy_from_slice(&end.to_le_bytes());
        file[243..247].copy_from_slice(&(evlrs.len() as u32).to_le_bytes());
        evlrs.iter().for_each(|record| file.extend(record.bytes(true)));
    }
}

/// A LAS 1.4 file without compression.
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
        let &LasFile { format, stride, scale, offset, vlrs, evlrs, records } = self;
        let header = Header { minor: 4, format, is_compressed: false, stride, scale, offset };
        let mut file = header.bytes(vlrs, records);
        file.extend(records);
        extend(&mut file, evlrs);
        file
    }
}

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
