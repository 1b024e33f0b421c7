//! Solid shapes: primitives in order, the last one that contains a point decides.

use crate::error::CoreError;
use glam::DVec3;

mod frustum;
mod torus;
pub use frustum::{Frustum, Slopes};
pub use torus::{Ring, Span, Torus};

/// What a primitive is. A cylinder lies along a world axis (0, 1, 2 for x, y, z); its section may be an ellipse.
/// A wedge is half of a cuboid, cut along a diagonal of its section across `axis`; `corner` has the signs, along
/// the two cross axes, of the corner that stays: the one with the right angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Cuboid,
    Cylinder { axis: usize },
    Wedge { axis: usize, corner: [i8; 2] },
    Frustum(Frustum),
    Torus(Torus),
}

/// Numbers that every packed row has, and those that rows of shapes with a frustum or a torus have.
pub const NARROW: usize = 8;
pub const WIDE: usize = 12;

impl Kind {
    /// The kind that a packed row's first number stands for, and its last four where it has them.
    pub fn from_code(code: f64, more: [f64; 4]) -> Option<Self> {
        let n = code as usize;
        let [a, b, c, d] = more;
        match n {
            _ if n as f64 != code => None,
            0 => Some(Kind::Cuboid),
            1..=3 => Some(Kind::Cylinder { axis: n - 1 }),
            4..=15 => {
                let corner = [n & 1, n >> 1 & 1].map(|bit| 2 * bit as i8 - 1);
                Some(Kind::Wedge { axis: n / 4 - 1, corner })
            }
            16..=21 => {
                let (axis, round) = ((n - 16) % 3, n >= 19);
                Some(Kind::Frustum(Frustum { axis, round, shear: [a, b], taper: [c, d] }))
            }
            22..=24 => Some(Kind::Torus(Torus { axis: n - 22, tube: a, arc: [b, c] })),
            _ => None,
        }
    }

    /// 0 for a cuboid, 1 + axis for a cylinder; 4 + 4 axis for a wedge, 1 and 2 more where its corner lies on the
    /// positive side of the first and the second cross axis; 16 + axis for a frustum, 19 + axis for a round one;
    /// 22 + axis for a torus. And the numbers that only some kinds have: shear and taper; or tube and arc.
    pub fn code(self) -> (f64, [f64; 4]) {
        let (n, more) = match self {
            Kind::Cuboid => (0, [0.0; 4]),
            Kind::Cylinder { axis } => (1 + axis, [0.0; 4]),
            Kind::Wedge { axis, corner: [u, v] } => {
                (4 + 4 * axis + usize::from(u > 0) + 2 * usize::from(v > 0), [0.0; 4])
            }
            Kind::Frustum(Frustum { axis, round, shear, taper }) => {
                (16 + 3 * usize::from(round) + axis, [shear[0], shear[1], taper[0], taper[1]])
            }
            Kind::Torus(Torus { axis, tube, arc }) => (22 + axis, [tube, arc[0], arc[1], 0.0]),
        };
        (n as f64, more)
    }

    /// Whether its row needs no more than the first numbers.
    fn is_narrow(self) -> bool {
        !matches!(self, Kind::Frustum(_) | Kind::Torus(_))
    }
}

/// One solid, added to what came before it or subtracted from it.
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
            Kind::Frustum(frustum) => {
                let (u, v) = cross_axes(frustum.axis);
                frustum.slopes(self.half).hold(frustum.round, [d[u], d[v], d[frustum.axis]])
            }
            Kind::Torus(torus) => {
                let (u, v) = cross_axes(torus.axis);
                torus.ring(self.half).hold([d[u], d[v], d[torus.axis]])
            }
        }
    }

    /// The mirror image about the plane z = 0.
    pub fn mirrored(mut self) -> Self {
        self.center.z = -self.center.z;
        match &mut self.kind {
            Kind::Wedge { axis: 0 | 1, corner: [_, z] } => *z = -*z,
            Kind::Frustum(frustum) => *frustum = frustum.mirrored(),
            Kind::Torus(torus) => *torus = torus.mirrored(),
            _ => {}
        }
        self
    }

    /// Lower and upper corner of a box around it.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let (lo, hi) = match self.kind {
            Kind::Frustum(frustum) => frustum.corners(self.half),
            Kind::Torus(torus) => torus.corners(self.half),
            _ => (-self.half, self.half),
        };
        (self.center + lo, self.center + hi)
    }

    fn fault(&self) -> Option<&'static str> {
        match self.kind {
            Kind::Frustum(frustum) => frustum.fault(),
            Kind::Torus(torus) => torus.fault(),
            _ => None,
        }
    }
}

/// The two axes across a primitive's own, in order.
#[inline(always)]
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
            if let Some(fault) = p.fault() {
                return Err(CoreError::BadPrimitive { index, fault });
            }
        }
        Ok(Self { primitives })
    }

    /// From rows of eight numbers: kind, op (1 adds, 0 subtracts), center, half; or of twelve (see `Kind::code`).
    pub fn from_rows<const N: usize>(rows: &[[f64; N]]) -> Result<Self, CoreError> {
        const { assert!(N == NARROW || N == WIDE) };
        let primitives = rows.iter().enumerate().map(|(index, row)| {
            let more = row[NARROW..].first_chunk();
            let kind = Kind::from_code(row[0], *more.unwrap_or(&[f64::NAN; 4]))
                .ok_or(CoreError::UnknownKind { index, kind: row[0] })?;
            if N == NARROW && !kind.is_narrow() {
                return Err(CoreError::ShortRow { index });
            }
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

    /// The rows that `from_rows` reads, one after the other, and how long each is: as short as they can be.
    pub fn to_rows(&self) -> (Vec<f64>, usize) {
        let width = if self.primitives.iter().all(|p| p.kind.is_narrow()) { NARROW } else { WIDE };
        let row = |p: &Primitive| {
            let ((kind, [e, f, g, h]), center, half) = (p.kind.code(), p.center, p.half);
            let op = f64::from(u8::from(p.additive));
            [kind, op, center.x, center.y, center.z, half.x, half.y, half.z, e, f, g, h]
        };
        (self.primitives.iter().flat_map(|p| row(p).into_iter().take(width)).collect(), width)
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
            .map(Primitive::bounds)
            .fold(none, |(lo, hi), (low, high)| (lo.min(low), hi.max(high)))
    }

    /// The shape moved by `-origin` and then scaled.
    pub fn moved(mut self, origin: DVec3, scale: f64) -> Self {
        for p in &mut self.primitives {
            p.center = (p.center - origin) * scale;
            p.half *= scale;
            if let Kind::Frustum(frustum) = &mut p.kind {
                frustum.shear = frustum.shear.map(|s| s * scale);
            }
        }
        self
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every kind, and frusta and tori with the limits of what they can be.
    pub fn any_kind() -> impl Strategy<Value = Kind> {
        let taper = || prop_oneof![-1.0..1.0, Just(0.0), Just(1.0), Just(-1.0)];
        let frustum = (0..3usize, any::<bool>(), [-0.3..0.3, -0.3..0.3], [taper(), taper()]).prop_map(
            |(axis, round, shear, [u, v])| {
                let taper = if round { [u, u] } else { [u, v] };
                Kind::Frustum(Frustum { axis, round, shear, taper })
            },
        );
        let turn = prop_oneof![10.0..360.0, Just(180.0), Just(360.0)];
        let tube = prop_oneof![0.05..0.5, Just(0.5)];
        let torus = (0..3usize, tube, -180.0..180.0, turn)
            .prop_map(|(axis, tube, from, turn)| Kind::Torus(Torus { axis, tube, arc: [from, from + turn] }));
        let plain = (0..16u8).prop_map(|n| Kind::from_code(n.into(), [0.0; 4]).unwrap());
        prop_oneof![plain, frustum, torus]
    }

    fn cuboid(center: [f64; 3], half: [f64; 3], additive: bool) -> Primitive {
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
        assert_eq!(Shape::from_rows(&rows).unwrap().to_rows(), (rows.as_flattened().to_vec(), NARROW));
        assert_eq!(Shape::from_rows::<NARROW>(&[]), Err(CoreError::NoPrimitives));
        let mut bad = rows;
        for kind in [25.0, 4.5, -1.0, f64::NAN] {
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
        for n in 0..25 {
            let more = match n {
                0..16 => [0.0; 4],
                16..22 => [0.1, 0.2, 0.3, 0.4],
                _ => [0.2, 30.0, 90.0, 0.0],
            };
            assert_eq!(Kind::from_code(f64::from(n), more).unwrap().code(), (f64::from(n), more));
        }
        assert_eq!(Kind::from_code(10.0, [0.0; 4]), Some(Kind::Wedge { axis: 1, corner: [-1, 1] }));
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
