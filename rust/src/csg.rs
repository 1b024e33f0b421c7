//! Solid shapes: cuboids and cylinders in order, the last one that contains a point decides.

use crate::error::CoreError;
use glam::DVec3;

/// What a primitive is. A cylinder lies along a world axis (0, 1, 2 for x, y, z); its section may be an ellipse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Cuboid,
    Cylinder { axis: usize },
}

/// One cuboid or cylinder, added to what came before it or subtracted from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primitive {
    pub kind: Kind,
    pub additive: bool,
    pub center: DVec3,
    pub half: DVec3,
}

impl Primitive {
    /// Whether the point lies in the primitive, its surface included.
    pub fn contains(&self, point: DVec3) -> bool {
        let d = (point - self.center).abs();
        match self.kind {
            Kind::Cuboid => d.cmple(self.half).all(),
            Kind::Cylinder { axis } => {
                let (u, v) = cross_axes(axis);
                let (a, b) = (d[u] / self.half[u], d[v] / self.half[v]);
                d[axis] <= self.half[axis] && a * a + b * b <= 1.0
            }
        }
    }

    /// The mirror image about the plane z = 0.
    pub fn mirrored(mut self) -> Self {
        self.center.z = -self.center.z;
        self
    }
}

/// The two axes across a cylinder's own.
pub fn cross_axes(axis: usize) -> (usize, usize) {
    match axis {
        0 => (1, 2),
        1 => (0, 2),
        _ => (0, 1),
    }
}

/// Primitives in order. Checked on the way in: at least one, all finite, all of some size.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    primitives: Vec<Primitive>,
}

impl Shape {
    pub fn new(primitives: Vec<Primitive>) -> Result<Self, CoreError> {
        if primitives.is_empty() {
            return Err(CoreError::NoPrimitives);
        }
        for (index, p) in primitives.iter().enumerate() {
            if !p.center.is_finite() || !p.half.is_finite() {
                return Err(CoreError::NotFinite { what: "shape" });
            }
            if p.half.min_element() <= 0.0 {
                let half = p.half.to_array();
                return Err(CoreError::ZeroSize { index, half });
            }
        }
        Ok(Self { primitives })
    }

    /// From rows of eight numbers: kind, op (1 adds, 0 subtracts), center, half.
    pub fn from_rows(rows: &[[f64; 8]]) -> Result<Self, CoreError> {
        let primitives = rows.iter().enumerate().map(|(index, row)| {
            let kind = match row[0] {
                0.0 => Kind::Cuboid,
                k if k == 1.0 || k == 2.0 || k == 3.0 => Kind::Cylinder { axis: k as usize - 1 },
                kind => return Err(CoreError::UnknownKind { index, kind }),
            };
            let additive = match row[1] {
                0.0 => false,
                1.0 => true,
                op => return Err(CoreError::UnknownOp { index, op }),
            };
            Ok(Primitive {
                kind,
                additive,
                center: DVec3::new(row[2], row[3], row[4]),
                half: DVec3::new(row[5], row[6], row[7]),
            })
        });
        Self::new(primitives.collect::<Result<_, _>>()?)
    }

    /// The rows that `from_rows` reads.
    pub fn to_rows(&self) -> Vec<[f64; 8]> {
        let row = |p: &Primitive| {
            let kind = match p.kind {
                Kind::Cuboid => 0.0,
                Kind::Cylinder { axis } => axis as f64 + 1.0,
            };
            let (c, h) = (p.center, p.half);
            [kind, f64::from(u8::from(p.additive)), c.x, c.y, c.z, h.x, h.y, h.z]
        };
        self.primitives.iter().map(row).collect()
    }

    pub fn primitives(&self) -> &[Primitive] {
        &self.primitives
    }

    /// Whether the last primitive that contains the point is additive.
    pub fn contains(&self, point: DVec3) -> bool {
        self.primitives.iter().rev().find(|p| p.contains(point)).is_some_and(|p| p.additive)
    }

    /// Lower and upper corner of a box that holds the shape: that of its additive primitives.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.primitives
            .iter()
            .filter(|p| p.additive)
            .fold(none, |(lo, hi), p| (lo.min(p.center - p.half), hi.max(p.center + p.half)))
    }

    /// The shape moved by `-origin` and then scaled.
    pub fn moved(mut self, origin: DVec3, scale: f64) -> Self {
        for p in &mut self.primitives {
            p.center = (p.center - origin) * scale;
            p.half *= scale;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub fn cuboid(center: [f64; 3], half: [f64; 3], additive: bool) -> Primitive {
        Primitive { kind: Kind::Cuboid, additive, center: center.into(), half: half.into() }
    }

    #[test]
    fn last_writer_wins() {
        let shape = Shape::new(vec![
            cuboid([0.0; 3], [0.3; 3], true),
            cuboid([0.0; 3], [0.2; 3], false),
            cuboid([0.0; 3], [0.1; 3], true),
        ])
        .unwrap();
        assert!(shape.contains(DVec3::splat(0.05)));
        assert!(!shape.contains(DVec3::splat(0.15)));
        assert!(shape.contains(DVec3::splat(0.25)));
        assert!(!shape.contains(DVec3::splat(0.35)));
    }

    #[test]
    fn rows_round_trip_and_bad_rows_are_refused() {
        let rows = [[0.0, 1.0, 0.1, 0.2, 0.3, 0.1, 0.1, 0.1], [3.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.1, 0.3]];
        assert_eq!(Shape::from_rows(&rows).unwrap().to_rows(), rows);
        assert_eq!(Shape::from_rows(&[]), Err(CoreError::NoPrimitives));
        let mut bad = rows;
        bad[1][0] = 4.0;
        assert!(matches!(Shape::from_rows(&bad), Err(CoreError::UnknownKind { index: 1, .. })));
        bad[1][0] = 1.0;
        bad[1][6] = 0.0;
        assert!(matches!(Shape::from_rows(&bad), Err(CoreError::ZeroSize { index: 1, .. })));
        bad[1][6] = f64::NAN;
        assert!(matches!(Shape::from_rows(&bad), Err(CoreError::NotFinite { .. })));
    }
}
