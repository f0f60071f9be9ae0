//! Which layers of a compressed record are to be read.

/// A set of layers. X, y, returns and scanner channel are always read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layers(u32);

impl Layers {
    /// Heights.
    pub const Z: Layers = Layers(1 << 1);
    /// Classes.
    pub const CLASS: Layers = Layers(1 << 2);
    /// Flags of the class and of the scan line.
    pub const FLAGS: Layers = Layers(1 << 3);
    /// Intensities.
    pub const INTENSITY: Layers = Layers(1 << 4);
    /// Scan angles.
    pub const ANGLE: Layers = Layers(1 << 5);
    /// User data.
    pub const USER: Layers = Layers(1 << 6);
    /// Point source identifiers.
    pub const SOURCE: Layers = Layers(1 << 7);
    /// GPS times.
    pub const TIME: Layers = Layers(1 << 8);
    /// Colours.
    pub const RGB: Layers = Layers(1 << 9);
    /// Infrared.
    pub const NIR: Layers = Layers(1 << 10);
    /// Waveform packets.
    pub const WAVES: Layers = Layers(1 << 11);
    /// Extra bytes.
    pub const EXTRA: Layers = Layers(1 << 12);
    /// All of them.
    pub const ALL: Layers = Layers(u32::MAX);

    /// These and others.
    #[must_use]
    pub fn and(self, others: Layers) -> Self {
        Layers(self.0 | others.0)
    }

    /// True if they hold one of `others`.
    pub fn has(self, others: Layers) -> bool {
        self.0 & others.0 != 0
    }

    /// True if they hold a layer of a point, by its place among those.
    pub fn has_point(self, layer: usize) -> bool {
        layer == 0 || self.0 & (1 << layer) != 0
    }
}
