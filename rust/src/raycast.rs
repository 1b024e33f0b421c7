//! Where a ray is inside a CSG shape: the exact intervals, with the faces they begin and end on.
//!
//! Primitives are applied in order to a short list of intervals: an additive one is united with it, a
//! subtractive one cut out of it. What remains is the shape along the ray; no tree, no sampling.
//! Rays are parametrised by depth along the camera's z axis, so an interval's ends are depths.

use crate::camera::{Camera, IMAGE};
use crate::csg::{Kind, Primitive, Shape, cross_axes};
use glam::DVec3;

/// Gaps and slivers shorter than this (world units) are rounding, not geometry.
const EPSILON: f64 = 1e-9;

/// The face of a primitive: its index, and 0, 1, 2 for a flat face across x, y, z, 3 for the curved or
/// slanted one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    primitive: u32,
    side: u8,
}

/// One stretch of a ray inside the shape, from depth `start` to depth `end`.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    pub start: f64,
    pub end: f64,
    pub entry: Face,
    exit: Face,
}

/// A shape prepared for the rays of one camera: who may be seen where in the image.
pub struct RayCaster<'a> {
    primitives: &'a [Primitive],
    camera: &'a Camera,
    /// Image bounds of each primitive: x from, x to, y from, y to, in [-1, 1] units of the image.
    bounds: Vec<[f64; 4]>,
}

impl<'a> RayCaster<'a> {
    pub fn new(shape: &'a Shape, camera: &'a Camera) -> Self {
        let primitives = shape.primitives();
        let bounds = primitives.iter().map(|p| image_bounds(p, camera)).collect();
        Self { primitives, camera, bounds }
    }

    /// Indices of the primitives that rays through this part of the image may meet, into `out`.
    pub fn visible(&self, x: (f64, f64), y: (f64, f64), out: &mut Vec<u32>) {
        out.clear();
        out.extend((0..self.primitives.len() as u32).filter(|&i| {
            let b = &self.bounds[i as usize];
            b[0] <= x.1 && x.0 <= b[1] && b[2] <= y.1 && y.0 <= b[3]
        }));
    }

    /// The stretches of the ray along `direction` (from the eye, one unit of depth) inside the shape, in order
    /// of depth, into `spans`. `candidates` comes from `visible`.
    pub fn spans(&self, direction: DVec3, candidates: &[u32], spans: &mut Vec<Span>) {
        spans.clear();
        let inverse = direction.recip();
        for &index in candidates {
            let primitive = &self.primitives[index as usize];
            if !primitive.additive && spans.is_empty() {
                continue;
            }
            let origin = self.camera.position - primitive.center;
            let Some((a, b, entry, exit)) = intersect(primitive, origin, direction, inverse) else {
                continue;
            };
            let face = |side| Face { primitive: index, side };
            let span = Span { start: a, end: b, entry: face(entry), exit: face(exit) };
            if primitive.additive {
                unite(spans, span);
            } else {
                cut(spans, &span);
            }
        }
        spans.retain(|s| s.start > 0.0);
    }

    /// The unit normal of a face where the ray meets it, turned towards the eye.
    pub fn normal(&self, face: Face, direction: DVec3, depth: f64) -> DVec3 {
        let p = &self.primitives[face.primitive as usize];
        let normal = match face.side {
            0 => DVec3::X,
            1 => DVec3::Y,
            2 => DVec3::Z,
            _ => round_or_slanted(p, self.camera.position + direction * depth - p.center),
        };
        if normal.dot(direction) > 0.0 { -normal } else { normal }
    }
}

/// A normal of the face that is not flat across an axis, at a point of it relative to the primitive's centre.
fn round_or_slanted(primitive: &Primitive, at: DVec3) -> DVec3 {
    let half = primitive.half;
    let mut normal = DVec3::ZERO;
    match primitive.kind {
        Kind::Cuboid => {}
        Kind::Cylinder { axis } => {
            let (u, v) = cross_axes(axis);
            (normal[u], normal[v]) = (at[u] / (half[u] * half[u]), at[v] / (half[v] * half[v]));
        }
        Kind::Wedge { axis, corner } => {
            let (u, v) = cross_axes(axis);
            (normal[u], normal[v]) = (f64::from(corner[0]) / half[u], f64::from(corner[1]) / half[v]);
        }
    }
    normal.normalize()
}

/// Entry and exit depth of a ray through one primitive, with the sides it enters and leaves by.
// In line, and wedges apart: drawing cuboids and cylinders takes a tenth longer otherwise.
#[inline(always)]
fn intersect(
    primitive: &Primitive,
    origin: DVec3,
    direction: DVec3,
    inverse: DVec3,
) -> Option<(f64, f64, u8, u8)> {
    let (mut a, mut b, mut entry, mut exit) = (f64::NEG_INFINITY, f64::INFINITY, 0, 0);
    let mut slab = |axis: usize| {
        let half = primitive.half[axis];
        if direction[axis] == 0.0 {
            return origin[axis].abs() <= half;
        }
        let (s, t) = ((-half - origin[axis]) * inverse[axis], (half - origin[axis]) * inverse[axis]);
        let (s, t) = if s <= t { (s, t) } else { (t, s) };
        if s > a {
            (a, entry) = (s, axis as u8);
        }
        if t < b {
            (b, exit) = (t, axis as u8);
        }
        a < b
    };
    match primitive.kind {
        Kind::Cuboid => {
            if !(slab(0) && slab(1) && slab(2)) {
                return None;
            }
        }
        Kind::Wedge { .. } => return intersect_wedge(primitive, origin, direction, inverse),
        Kind::Cylinder { axis } => {
            if !slab(axis) {
                return None;
            }
            let (u, v) = cross_axes(axis);
            let (iu, iv) = (1.0 / primitive.half[u], 1.0 / primitive.half[v]);
            let (ou, ov, du, dv) = (origin[u] * iu, origin[v] * iv, direction[u] * iu, direction[v] * iv);
            let (qa, qb, qc) = (du * du + dv * dv, ou * du + ov * dv, ou * ou + ov * ov - 1.0);
            if qa == 0.0 {
                if qc > 0.0 {
                    return None;
                }
            } else {
                let discriminant = qb * qb - qa * qc;
                if discriminant <= 0.0 {
                    return None;
                }
                let root = discriminant.sqrt();
                let (s, t) = ((-qb - root) / qa, (-qb + root) / qa);
                if s > a {
                    (a, entry) = (s, 3);
                }
                if t < b {
                    (b, exit) = (t, 3);
                }
                if a >= b {
                    return None;
                }
            }
        }
    }
    (b > 0.0).then_some((a, b, entry, exit))
}

/// What `intersect` finds of a wedge: its box, clipped by its slanted face.
#[inline(never)]
fn intersect_wedge(
    primitive: &Primitive,
    origin: DVec3,
    direction: DVec3,
    inverse: DVec3,
) -> Option<(f64, f64, u8, u8)> {
    let Kind::Wedge { axis, corner } = primitive.kind else { return None };
    let cuboid = Primitive { kind: Kind::Cuboid, ..*primitive };
    let (mut a, mut b, mut entry, mut exit) = intersect(&cuboid, origin, direction, inverse)?;
    let (u, v) = cross_axes(axis);
    let (nu, nv) = (f64::from(corner[0]) / primitive.half[u], f64::from(corner[1]) / primitive.half[v]);
    // How far inside the slanted face, at the eye and for each unit of depth.
    let (within, slope) = (nu * origin[u] + nv * origin[v], nu * direction[u] + nv * direction[v]);
    let t = -within / slope;
    if slope > 0.0 && t > a {
        (a, entry) = (t, 3);
    }
    if slope < 0.0 && t < b {
        (b, exit) = (t, 3);
    }
    let missed = a >= b || b <= 0.0 || (slope == 0.0 && within < 0.0);
    (!missed).then_some((a, b, entry, exit))
}

/// Adds a stretch, joining it with those it touches.
fn unite(spans: &mut Vec<Span>, mut new: Span) {
    let first = spans.partition_point(|s| s.end < new.start - EPSILON);
    let mut last = first;
    while last < spans.len() && spans[last].start <= new.end + EPSILON {
        let old = spans[last];
        if old.start < new.start - EPSILON {
            (new.start, new.entry) = (old.start, old.entry);
        }
        if old.end > new.end + EPSILON {
            (new.end, new.exit) = (old.end, old.exit);
        }
        last += 1;
    }
    if first == last {
        spans.insert(first, new);
    } else {
        spans[first] = new;
        spans.drain(first + 1..last);
    }
}

/// Takes a stretch away.
fn cut(spans: &mut Vec<Span>, hole: &Span) {
    let mut i = 0;
    while i < spans.len() {
        let old = spans[i];
        if old.end <= hole.start + EPSILON || old.start >= hole.end - EPSILON {
            i += 1;
            continue;
        }
        let before =
            (hole.start - old.start > EPSILON).then_some(Span { end: hole.start, exit: hole.entry, ..old });
        let after =
            (old.end - hole.end > EPSILON).then_some(Span { start: hole.end, entry: hole.exit, ..old });
        let left = usize::from(before.is_some()) + usize::from(after.is_some());
        spans.splice(i..=i, before.into_iter().chain(after));
        i += left;
    }
}

/// A rectangle of the image, in [-1, 1] units, that holds the primitive; all of it when part lies behind the eye.
fn image_bounds(primitive: &Primitive, camera: &Camera) -> [f64; 4] {
    let margin = 1e-6 / IMAGE as f64;
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for corner in 0..8 {
        let sign = DVec3::new(
            f64::from(corner & 1) * 2.0 - 1.0,
            f64::from(corner >> 1 & 1) * 2.0 - 1.0,
            f64::from(corner >> 2) * 2.0 - 1.0,
        );
        let p = camera.to_camera(primitive.center + primitive.half * sign);
        if p.z <= 1e-3 {
            return [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY];
        }
        let (x, y) = (p.x / (p.z * camera.half_image), p.y / (p.z * camera.half_image));
        bounds[0] = bounds[0].min(x - margin);
        bounds[1] = bounds[1].max(x + margin);
        bounds[2] = bounds[2].min(y - margin);
        bounds[3] = bounds[3].max(y + margin);
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_shape() -> impl Strategy<Value = Shape> {
        let triple = |lo: f64, hi: f64| [lo..hi, lo..hi, lo..hi];
        let primitive = (0..16u8, any::<bool>(), triple(-0.3, 0.3), triple(0.02, 0.25)).prop_map(
            |(kind, additive, center, half)| Primitive {
                kind: Kind::from_code(kind.into()).unwrap(),
                additive,
                center: center.into(),
                half: half.into(),
            },
        );
        prop::collection::vec(primitive, 1..9).prop_map(|p| Shape::new(p).unwrap())
    }

    proptest! {
        #[test]
        fn spans_agree_with_points_along_the_ray(
            shape in any_shape(), x in -0.9..0.9, y in -0.9..0.9, azimuth in 0.0..360.0, elevation in -80.0..80.0
        ) {
            let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
            let caster = RayCaster::new(&shape, &camera);
            let direction = camera.ray(x, y);
            let (mut candidates, mut spans) = (Vec::new(), Vec::new());
            caster.visible((x, x), (y, y), &mut candidates);
            caster.spans(direction, &candidates, &mut spans);
            for pair in spans.windows(2) {
                prop_assert!(pair[0].end < pair[1].start);
            }
            for k in 0..400 {
                let depth = 1.25 + 1.5 * (f64::from(k) + 0.37) / 400.0;
                let near_an_end = spans.iter().any(|s| (s.start - depth).abs().min((s.end - depth).abs()) < 1e-7);
                if !near_an_end {
                    let within = spans.iter().any(|s| s.start < depth && depth < s.end);
                    prop_assert_eq!(within, shape.contains(camera.position + direction * depth));
                }
            }
        }
    }

    #[test]
    fn a_shared_face_leaves_no_gap_and_a_hole_shows_its_far_wall() {
        let cuboid = |center: [f64; 3], half: [f64; 3], additive| Primitive {
            kind: Kind::Cuboid,
            additive,
            center: center.into(),
            half: half.into(),
        };
        let shape = Shape::new(vec![
            cuboid([0.1, 0.0, 0.0], [0.1, 0.2, 0.2], true),
            cuboid([-0.1, 0.0, 0.0], [0.1, 0.2, 0.2], true),
            cuboid([0.2, 0.0, 0.0], [0.1, 0.1, 0.1], false),
        ])
        .unwrap();
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let caster = RayCaster::new(&shape, &camera);
        let mut spans = Vec::new();
        caster.spans(camera.ray(0.0, 0.0), &[0, 1, 2], &mut spans);
        assert_eq!(spans.len(), 1);
        assert!((spans[0].start - 1.9).abs() < 1e-12 && (spans[0].end - 2.2).abs() < 1e-12);
        let normal = caster.normal(spans[0].entry, camera.ray(0.0, 0.0), spans[0].start);
        assert!((normal - DVec3::X).length() < 1e-12, "{normal}");
    }

    #[test]
    fn a_slanted_face_has_its_depth_and_its_normal() {
        // Seen from the front, the ray along -x meets x / 0.2 + y / 0.1 = 0, the face of a ramp, at the origin; one
        // through height y at depth 1 where 2 - depth = -2 y depth.
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let kind = Kind::Wedge { axis: 2, corner: [-1, -1] };
        let half = DVec3::new(0.2, 0.1, 0.3);
        let primitive = Primitive { kind, additive: true, center: DVec3::ZERO, half };
        let shape = Shape::new(vec![primitive]).unwrap();
        let caster = RayCaster::new(&shape, &camera);
        let mut spans = Vec::new();
        for image_y in [-0.1, 0.0, 0.1] {
            let direction = camera.ray(0.0, image_y);
            caster.spans(direction, &[0], &mut spans);
            let expected = 2.0 / (1.0 - 2.0 * direction.y);
            assert_eq!(spans.len(), 1);
            assert!((spans[0].start - expected).abs() < 1e-12, "{} {expected}", spans[0].start);
            let normal = caster.normal(spans[0].entry, direction, spans[0].start);
            let across = DVec3::new(1.0, 2.0, 0.0).normalize();
            assert!((normal - across).length() < 1e-12, "{normal}");
        }
    }
}
