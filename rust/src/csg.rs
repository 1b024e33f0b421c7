//! Solid shapes: cuboids, cylinders and wedges in order, the last one that contains a point decides.

use crate::error::CoreError;
use glam::DVec3;

/// What a primitive is. A cylinder lies along a world axis (0, 1, 2 for x, y, z); its section may be an ellipse.
/// A wedge is half of a cuboid, cut along a diagonal of its section across `axis`; `corner` has the signs, along
/// the two cross axes, of the corner that stays: the one with the right angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Cuboid,
    Cylinder { axis: usize },
    Wedge { axis: usize, corner: [i8; 2] },
}

impl Kind {
    /// The kind that a packed row's first number stands for.
    pub fn from_code(code: f64) -> Option<Self> {
        let n = code as usize;
        match n {
            _ if n as f64 != code => None,
            0 => Some(Kind::Cuboid),
            1..=3 => Some(Kind::Cylinder { axis: n - 1 }),
            4..=15 => {
                let corner = [n & 1, n >> 1 & 1].map(|bit| 2 * bit as i8 - 1);
                Some(Kind::Wedge { axis: n / 4 - 1, corner })
            }
            _ => None,
        }
    }

    /// 0 for a cuboid, 1 + axis for a cylinder; 4 + 4 axis for a wedge, 1 and 2 more where its corner lies on the
    /// positive side of the first and the second cross axis.
    pub fn code(self) -> f64 {
        let n = match self {
            Kind::Cuboid => 0,
            Kind::Cylinder { axis } => 1 + axis,
            Kind::Wedge { axis, corner: [u, v] } => {
                4 + 4 * axis + usize::from(u > 0) + 2 * usize::from(v > 0)
            }
        };
        n as f64
    }
}

/// One cuboid, cylinder or wedge, added to what came before it or subtracted from it.
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
        let d = point - self.center;
        let within = d.abs().cmple(self.half);
        match self.kind {
            Kind::Cuboid => within.all(),
            Kind::Cylinder { axis } => {
                let (u, v) = cross_axes(axis);
                let (a, b) = (d[u] / self.half[u], d[v] / self.half[v]);
                within.test(axis) && a * a + b * b <= 1.0
            }
            Kind::Wedge { axis, corner } => {
                let (u, v) = cross_axes(axis);
                let (a, b) = (d[u] / self.half[u], d[v] / self.half[v]);
                within.all() && f64::from(corner[0]) * a + f64::from(corner[1]) * b >= 0.0
            }
        }
    }

    /// The mirror image about the plane z = 0.
    pub fn mirrored(mut self) -> Self {
        self.center.z = -self.center.z;
        if let Kind::Wedge { axis: 0 | 1, corner: [_, z] } = &mut self.kind {
            *z = -*z;
        }
        self
    }
}

/// The two axes across a cylinder's or a wedge's own, in order.
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

    /// From rows of eight numbers: kind (see `Kind::code`), op (1 adds, 0 subtracts), center, half.
    pub fn from_rows(rows: &[[f64; 8]]) -> Result<Self, CoreError> {
        let primitives = rows.iter().enumerate().map(|(index, row)| {
            let kind = Kind::from_code(row[0]).ok_or(CoreError::UnknownKind { index, kind: row[0] })?;
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
            let (c, h) = (p.center, p.half);
            [p.kind.code(), f64::from(u8::from(p.additive)), c.x, c.y, c.z, h.x, h.y, h.z]
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
        for kind in [16.0, 4.5, -1.0, f64::NAN] {
            bad[1][0] = kind;
            assert!(matches!(Shape::from_rows(&bad), Err(CoreError::UnknownKind { index: 1, .. })));
        }
        bad[1][0] = 1.0;
        bad[1][6] = 0.0;
        assert!(matches!(Shape::from_rows(&bad), Err(CoreError::ZeroSize { index: 1, .. })));
        bad[1][6] = f64::NAN;
        assert!(matches!(Shape::from_rows(&bad), Err(CoreError::NotFinite { .. })));
    }

    #[test]
    fn kinds_round_trip_through_their_codes() {
        for n in 0..16 {
            assert_eq!(Kind::from_code(f64::from(n)).unwrap().code(), f64::from(n));
        }
        assert_eq!(Kind::from_code(10.0), Some(Kind::Wedge { axis: 1, corner: [-1, 1] }));
    }

    #[test]
    fn a_wedge_keeps_its_corner_and_its_slanted_face() {
        let wedge = |axis, corner| Primitive {
            kind: Kind::Wedge { axis, corner },
            ..cuboid([0.1, 0.2, 0.3], [0.1, 0.2, 0.4], true)
        };
        for axis in 0..3 {
            let (u, v) = cross_axes(axis);
            for corner in [[-1, -1], [-1, 1], [1, -1], [1, 1]] {
                let p = wedge(axis, corner);
                let at = |a: f64, b: f64, along: f64| {
                    let mut parts = DVec3::splat(along);
                    (parts[u], parts[v]) = (a * f64::from(corner[0]), b * f64::from(corner[1]));
                    p.contains(p.center + parts * p.half)
                };
                for along in [-0.9, 0.0, 0.9] {
                    assert!(at(0.9, 0.9, along) && at(0.9, -0.8, along) && at(0.0, 0.0, along));
                    assert!(!at(-0.9, -0.9, along) && !at(0.8, -0.9, along) && !at(1.1, 0.9, along));
                }
                assert!(!at(0.9, 0.9, 1.1) && !at(0.9, 0.9, -1.1));
            }
        }
        let flipped = |axis, corner| wedge(axis, corner).mirrored().kind;
        assert_eq!(flipped(0, [1, 1]), Kind::Wedge { axis: 0, corner: [1, -1] });
        assert_eq!(flipped(1, [-1, -1]), Kind::Wedge { axis: 1, corner: [-1, 1] });
        assert_eq!(flipped(2, [1, -1]), Kind::Wedge { axis: 2, corner: [1, -1] });
    }
}
