//! Where rays meet one primitive, and its normals there.
//!
//! Points of a ray are named by their *nearness*, 1 / depth along the camera's z axis: it is affine over the image on
//! every plane, so a ray meets a plane by one product, a cylinder by one square root, and nothing is divided. Rays go
//! in tiles of 8 x 8; every step is a loop over the 64 rays, which the compiler vectorises.

#![expect(clippy::needless_range_loop, reason = "loops over the rays of a tile index many arrays at once")]

use crate::camera::{Camera, IMAGE};
use crate::csg::{Kind, Primitive, cross_axes};
use glam::DVec3;

mod frustum;
mod plane;
mod torus;
use frustum::Cone;
use plane::Plane;
pub use torus::{Arc, STRETCHES};

/// The nearness of points at the eye or behind it.
pub const NEAREST: f64 = 1e8;
/// Instead of a distance of 0, so that the eye may lie in the plane of a face.
const NO_DISTANCE: f64 = 1e-290;

/// Rays along each side of a tile.
pub const TILE: usize = 8;
/// Rays of a tile, row by row.
pub const RAYS: usize = TILE * TILE;
/// One number for each ray of a tile.
pub type Lanes = [f64; RAYS];

/// A primitive as the eye has it.
pub struct Placed {
    pub primitive: Primitive,
    /// From the primitive's centre to the eye.
    origin: DVec3,
    /// For the lower and the upper face across each axis, 1 / its distance from the eye along the axis.
    faces: [[f64; 2]; 3],
    curved: Curved,
    /// Image bounds: x from, x to, y from, y to, in [-1, 1] units of the image.
    pub bounds: [f64; 4],
}

/// What a frustum or a torus is bounded by, beside flat faces across an axis.
enum Curved {
    No,
    Sides([Plane; 4]),
    Cone(Cone),
    Arc(Arc),
}

impl Placed {
    pub fn new(primitive: &Primitive, camera: &Camera) -> Self {
        let origin = camera.position - primitive.center;
        let half = primitive.half;
        // An eye in the plane of a face counts as between the two.
        let distances = |a: usize| [-half[a] - origin[a] - NO_DISTANCE, half[a] - origin[a] + NO_DISTANCE];
        let faces = [0, 1, 2].map(|a| distances(a).map(f64::recip));
        let curved = match primitive.kind {
            Kind::Frustum(f) if f.round => Curved::Cone(Cone::new(&f.slopes(half), f.axis, origin)),
            Kind::Frustum(f) => Curved::Sides(frustum::sides(&f.slopes(half), f.axis, origin)),
            Kind::Torus(t) => Curved::Arc(Arc::new(&t, half, origin)),
            _ => Curved::No,
        };
        Self { primitive: *primitive, origin, faces, curved, bounds: image_bounds(primitive, camera) }
    }

    /// The most stretches of a ray that can be inside it.
    pub fn intervals(&self) -> usize {
        if matches!(self.curved, Curved::Arc(_)) { STRETCHES } else { 1 }
    }

    /// A torus, which alone is crossed more than once.
    #[inline(always)]
    pub fn arc(&self) -> Option<&Arc> {
        if let Curved::Arc(arc) = &self.curved { Some(arc) } else { None }
    }

    /// Where rays of these directions enter and leave the primitive: from one nearness to a lesser one; from 0 to `NEAREST`
    /// if they miss it. Whether any meets it. Of a torus, the box around it.
    #[inline(always)]
    pub fn cross(&self, direction: &[Lanes; 3], start: &mut Lanes, end: &mut Lanes) -> bool {
        (*start, *end) = ([NEAREST; RAYS], [0.0; RAYS]);
        for axis in self.flat_axes() {
            cross_slab(self.faces[axis], &direction[axis], start, end);
        }
        let half = self.primitive.half;
        match self.primitive.kind {
            Kind::Cuboid | Kind::Torus(_) => {}
            Kind::Frustum(_) => match &self.curved {
                Curved::Sides(planes) => planes.iter().for_each(|plane| plane.clip(direction, start, end)),
                Curved::Cone(cone) => cone.clip(direction, start, end),
                _ => {}
            },
            Kind::Cylinder { axis } => {
                let (u, v) = cross_axes(axis);
                let (iu, iv) = (1.0 / half[u], 1.0 / half[v]);
                let origin = [self.origin[u] * iu, self.origin[v] * iv];
                let mut across = [direction[u], direction[v]];
                for r in 0..RAYS {
                    (across[0][r], across[1][r]) = (across[0][r] * iu, across[1][r] * iv);
                }
                cross_circle(origin, &across, start, end);
            }
            Kind::Wedge { axis, corner } => {
                let (u, v) = cross_axes(axis);
                let (nu, nv) = (f64::from(corner[0]) / half[u], f64::from(corner[1]) / half[v]);
                // How far inside the slanted face the eye is; and the ray, for each unit of depth.
                let within = nu * self.origin[u] + nv * self.origin[v];
                let inverse = -1.0 / if within == 0.0 { NO_DISTANCE } else { within };
                let (du, dv) = (&direction[u], &direction[v]);
                for r in 0..RAYS {
                    let at = (nu * du[r] + nv * dv[r]) * inverse;
                    if within < 0.0 {
                        start[r] = less(at, start[r]);
                    } else {
                        end[r] = greater(at, end[r]);
                    }
                }
            }
        }
        let mut any = 0;
        for r in 0..RAYS {
            let hit = start[r] > end[r];
            start[r] = if hit { start[r] } else { 0.0 };
            end[r] = if hit { end[r] } else { NEAREST };
            any |= start[r].to_bits();
        }
        any != 0
    }

    /// Unit normals, turned towards the eye, where rays meet it; those at a nearness of 0 are left as they are.
    ///
    /// The face is the first one that the ray meets just there: flat ones in the order of their axes, then the curved
    /// or slanted one.
    #[inline(always)]
    pub fn normals(&self, direction: &[Lanes; 3], mut nearness: Lanes, normals: &mut [Lanes; 3]) {
        if let Curved::Arc(arc) = &self.curved {
            return arc.normals(direction, nearness, normals);
        }
        for axis in self.flat_axes() {
            let [low, high] = self.faces[axis];
            let normal = &mut normals[axis];
            for r in 0..RAYS {
                let (d, at) = (direction[axis][r], nearness[r]);
                let here = (at > 0.0) & ((low * d == at) | (high * d == at));
                normal[r] = if here { -1f64.copysign(d) } else { normal[r] };
                nearness[r] = if here { 0.0 } else { at };
            }
        }
        match &self.curved {
            Curved::Sides(planes) => {
                planes.iter().for_each(|plane| plane.normals(direction, &mut nearness, normals));
            }
            Curved::Cone(cone) => cone.normals(direction, &nearness, normals),
            _ => {}
        }
        let (Kind::Cylinder { axis } | Kind::Wedge { axis, .. }) = self.primitive.kind else { return };
        let (u, v) = cross_axes(axis);
        let (du, dv) = (&direction[u], &direction[v]);
        let (ou, ov, half) = (self.origin[u], self.origin[v], self.primitive.half);
        let (iu, iv) = (1.0 / (half[u] * half[u]), 1.0 / (half[v] * half[v]));
        for r in 0..RAYS {
            let (nu, nv) = match self.primitive.kind {
                Kind::Wedge { corner, .. } => {
                    (f64::from(corner[0]) / half[u], f64::from(corner[1]) / half[v])
                }
                // The gradient, times the nearness.
                _ => ((ou * nearness[r] + du[r]) * iu, (ov * nearness[r] + dv[r]) * iv),
            };
            let unit = 1.0 / (nu * nu + nv * nv).sqrt();
            let unit = if nu * du[r] + nv * dv[r] > 0.0 { -unit } else { unit };
            let here = nearness[r] > 0.0;
            normals[u][r] = if here { nu * unit } else { normals[u][r] };
            normals[v][r] = if here { nv * unit } else { normals[v][r] };
        }
    }

    /// The axes across which it has two flat faces.
    #[inline(always)]
    fn flat_axes(&self) -> std::ops::Range<usize> {
        match self.primitive.kind {
            Kind::Cylinder { axis } => axis..axis + 1,
            Kind::Frustum(frustum) => frustum.axis..frustum.axis + 1,
            _ => 0..3,
        }
    }
}

/// Clips rays by two parallel faces. An eye between them sees only one of the two, from within.
#[inline(always)]
fn cross_slab([low, high]: [f64; 2], direction: &Lanes, start: &mut Lanes, end: &mut Lanes) {
    if low < 0.0 && high > 0.0 {
        for r in 0..RAYS {
            end[r] = greater(greater(low * direction[r], high * direction[r]), end[r]);
        }
    } else {
        for r in 0..RAYS {
            let (s, t) = (low * direction[r], high * direction[r]);
            start[r] = less(greater(s, t), start[r]);
            end[r] = greater(less(s, t), end[r]);
        }
    }
}

/// Clips rays by the unit circle; `origin` and `direction` are two-dimensional.
///
/// Depth t has |origin + t direction| = 1, so nearness w has qc w^2 + 2 qb w + qa = 0, where only qc, which is less than
/// 0 for an eye within the circle, is the same for all rays.
#[inline(always)]
fn cross_circle(origin: [f64; 2], direction: &[Lanes; 2], start: &mut Lanes, end: &mut Lanes) {
    let qc = origin[0] * origin[0] + origin[1] * origin[1] - 1.0;
    let inverse = 1.0 / if qc == 0.0 { NO_DISTANCE } else { qc };
    for r in 0..RAYS {
        let (du, dv) = (direction[0][r], direction[1][r]);
        let (qa, qb) = (du * du + dv * dv, origin[0] * du + origin[1] * dv);
        let discriminant = qb * qb - qa * qc;
        let root = discriminant.sqrt();
        if qc > 0.0 {
            let entry = if discriminant > 0.0 { (root - qb) * inverse } else { 0.0 };
            start[r] = less(entry, start[r]);
            end[r] = greater((-root - qb) * inverse, end[r]);
        } else {
            end[r] = greater((-root - qb) * inverse, end[r]);
        }
    }
}

/// The lesser one; `b` if either is no number.
#[inline(always)]
pub fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater one; `b` if either is no number.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A rectangle of the image, in [-1, 1] units, that holds the primitive; all of it when part lies behind the eye.
fn image_bounds(primitive: &Primitive, camera: &Camera) -> [f64; 4] {
    let margin = 1e-6 / IMAGE as f64;
    let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    let (lo, hi) = primitive.bounds();
    for corner in 0..8 {
        let pick = |a: usize| if corner >> a & 1 == 0 { lo[a] } else { hi[a] };
        let p = camera.to_camera(DVec3::new(pick(0), pick(1), pick(2)));
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
