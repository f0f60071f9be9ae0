//! The area of a crop, in world units and in the steps in which records store coordinates.

use crate::geom::polygon::{Area, PolygonCorner, PolygonRings};
use crate::point::{Dimension, Endian, Schema};
use crate::quantity::CropBox;
use crate::{Error, Result};

/// An area in world units.
#[derive(Debug)]
pub(super) enum AreaShape {
    Box(CropBox),
    Polygons(Vec<PolygonRings>),
}

/// An area in what records store: whole steps, or numbers as they are.
#[derive(Debug)]
pub(super) struct Fitted {
    /// The fields of x, y and, where heights count, z.
    axes: Vec<Dimension>,
    area: FittedArea,
}

#[derive(Debug)]
enum FittedArea {
    Box { lo: Vec<f64>, hi: Vec<f64> },
    Polygons(Area),
}

/// A corner nearer to a step than this part of one is on it.
const ON_STEP: f64 = 1e-3;

/// A world coordinate in what a field stores.
fn stored(world: f64, field: &Dimension) -> f64 {
    let stored = (world - field.origin) / field.scale;
    let whole = stored.round();
    let is_on = !field.scalar.is_float() && (stored - whole).abs() < ON_STEP;
    if is_on { whole } else { stored }
}

impl AreaShape {
    /// True if z decides, too.
    pub fn has_heights(&self) -> bool {
        matches!(self, AreaShape::Box(bounds) if bounds.lo().len() > 2)
    }

    /// The smallest and the largest x and y.
    pub fn bounds(&self) -> [PolygonCorner; 2] {
        match self {
            AreaShape::Box(bounds) => {
                [bounds.lo(), bounds.hi()].map(|corner| [corner[0], corner[1]])
            }
            AreaShape::Polygons(polygons) => Area::of(polygons).bounds(),
        }
    }

    /// The area for records of `schema`.
    pub fn fit(&self, schema: &Schema) -> Result<Fitted> {
        let axes = schema
            .coordinates()
            .ok_or_else(|| Error::pipeline("the input has no coordinates X, Y and Z"))?;
        let axes = &axes[..if self.has_heights() { 3 } else { 2 }];
        let each = |corner: &[f64]| -> Vec<f64> {
            corner.iter().zip(axes).map(|(v, axis)| stored(*v, axis)).collect()
        };
        let area = match self {
            AreaShape::Box(bounds) => {
                FittedArea::Box { lo: each(bounds.lo()), hi: each(bounds.hi()) }
            }
            AreaShape::Polygons(polygons) => {
                let corner = |[x, y]: &PolygonCorner| [stored(*x, axes[0]), stored(*y, axes[1])];
                let ring = |ring: &Vec<PolygonCorner>| ring.iter().map(corner).collect();
                let rings = |rings: &PolygonRings| rings.iter().map(ring).collect();
                FittedArea::Polygons(Area::of(&polygons.iter().map(rings).collect::<Vec<_>>()))
            }
        };
        Ok(Fitted { axes: axes.iter().map(|axis| (*axis).clone()).collect(), area })
    }
}

impl Fitted {
    /// True if a record is inside.
    pub fn contains(&self, record: &[u8], endian: Endian) -> bool {
        let at = |axis: &Dimension| axis.get(record, endian).as_f64();
        match &self.area {
            FittedArea::Box { lo, hi } => {
                let mut sides = self.axes.iter().zip(lo.iter().zip(hi));
                sides.all(|(axis, (lo, hi))| (*lo..=*hi).contains(&at(axis)))
            }
            FittedArea::Polygons(area) => area.contains([at(&self.axes[0]), at(&self.axes[1])]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Layout, Scalar, Value, names};

    #[test]
    fn corners_at_decimals_are_on_the_steps_that_they_name() {
        for origin in [0.0, 0.3, 500_000.0, 4_100_000.07] {
            let axis = |(i, name)| Dimension::new(name, Scalar::I32, 4 * i).scaled(0.001, origin);
            let dimensions: Vec<_> = names::XYZ.into_iter().enumerate().map(axis).collect();
            let layout = Layout { steps: true, ..Layout::plain("TOY") };
            let schema = Schema { layout, endian: Endian::Little, stride: 12, dimensions };
            let mut at = vec![0; 12];
            for n in (-2000..2000).step_by(7) {
                // As people write them: three digits.
                let decimal = |n: i32| format!("{:.3}", origin + f64::from(n) * 0.001);
                let [lo, hi] = [n, n + 1].map(|n| decimal(n).parse::<f64>().unwrap());
                let bounds = CropBox::try_from(vec![lo, lo, hi, hi]).unwrap();
                let square = vec![vec![[lo, lo], [hi, lo], [hi, hi], [lo, hi]]];
                for shape in [AreaShape::Box(bounds), AreaShape::Polygons(vec![square])] {
                    let fitted = shape.fit(&schema).unwrap();
                    for (step, expected) in [(-1, false), (0, true), (1, true), (2, false)] {
                        for axis in &schema.dimensions[..2] {
                            let stored = Value::Signed(i64::from(n + step));
                            assert!(axis.put(&mut at, Endian::Little, stored));
                        }
                        let is_in = fitted.contains(&at, Endian::Little);
                        assert_eq!(is_in, expected, "step {} of {shape:?}, {origin}", n + step);
                    }
                }
            }
        }
    }
}
