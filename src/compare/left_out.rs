//! Which points are not looked at.

use crate::graph::Treatment;
use crate::point::{Flag, Selection};

/// The classes of low and high noise.
const NOISE: [u8; 2] = [7, 18];

/// Points that are looked at where noise and withheld points are treated so; None of either: they
/// are points like all others.
pub(super) fn looked_at(noise: Option<Treatment>, withheld: Option<Treatment>) -> Selection {
    let leaves = |treatment: Option<Treatment>| treatment.is_some_and(|is| is != Treatment::Keep);
    Selection {
        not_classes: if leaves(noise) { NOISE.to_vec() } else { Vec::new() },
        without: if leaves(withheld) { vec![Flag::Withheld] } else { Vec::new() },
        ..Selection::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_left_out_where_they_are_not_kept() {
        assert!(looked_at(None, Some(Treatment::Keep)).is_all());
        assert_eq!(looked_at(Some(Treatment::Drop), None).not_classes, [7, 18]);
        assert_eq!(looked_at(None, Some(Treatment::Ignore)).without, [Flag::Withheld]);
    }
}
