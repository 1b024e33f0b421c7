//! Planes at any slant: the sides of tapered cuboids, and the ends of arcs.

#![expect(clippy::needless_range_loop, reason = "loops over the rays of a tile index many arrays at once")]

use super::{Lanes, NO_DISTANCE, RAYS, greater, less};
use glam::DVec3;

/// A half-space.
#[derive(Clone, Copy)]
pub struct Plane {
    /// Unit normal, outwards.
    normal: DVec3,
    /// -1 / how far outside the eye is; it is greater than 0 for an eye inside.
    inverse: f64,
}

impl Plane {
    /// The half-space of points whose offset from one in the plane has no positive part along a normal of any length.
    pub fn new(normal: DVec3, to_eye: DVec3) -> Self {
        let normal = normal.normalize();
        let distance = normal.dot(to_eye);
        Self { normal, inverse: -1.0 / if distance == 0.0 { NO_DISTANCE } else { distance } }
    }

    /// Whether the eye is inside.
    #[inline(always)]
    pub fn eye_is_inside(&self) -> bool {
        self.inverse > 0.0
    }

    /// How near the point is where one ray meets the plane; less than 0 where that lies behind the eye.
    #[inline(always)]
    pub fn meets(&self, direction: &[Lanes; 3], r: usize) -> f64 {
        let n = self.normal;
        (n.x * direction[0][r] + n.y * direction[1][r] + n.z * direction[2][r]) * self.inverse
    }

    /// Clips rays by the half-space.
    #[inline(always)]
    pub fn clip(&self, direction: &[Lanes; 3], start: &mut Lanes, end: &mut Lanes) {
        if self.eye_is_inside() {
            for r in 0..RAYS {
                end[r] = greater(self.meets(direction, r), end[r]);
            }
        } else {
            for r in 0..RAYS {
                start[r] = less(self.meets(direction, r), start[r]);
            }
        }
    }

    /// Its normal, turned towards the eye, where rays meet it; those points are taken out of `nearness`.
    #[inline(always)]
    pub fn normals(&self, direction: &[Lanes; 3], nearness: &mut Lanes, normals: &mut [Lanes; 3]) {
        // An eye inside sees the inner side.
        let towards = if self.eye_is_inside() { -self.normal } else { self.normal };
        for r in 0..RAYS {
            let here = (nearness[r] > 0.0) & (self.meets(direction, r) == nearness[r]);
            for axis in 0..3 {
                normals[axis][r] = if here { towards[axis] } else { normals[axis][r] };
            }
            nearness[r] = if here { 0.0 } else { nearness[r] };
        }
    }
}
