//! Frusta: between two flat ends, the four sides of a tapered cuboid or the mantle of a cone.

use super::plane::Plane;
use super::{Lanes, NO_DISTANCE, RAYS, greater, less};
use crate::csg::{Slopes, cross_axes};
use glam::DVec3;

/// The slanted sides of a frustum whose section is a rectangle.
pub fn sides(slopes: &Slopes, axis: usize, origin: DVec3) -> [Plane; 4] {
    let (u, v) = cross_axes(axis);
    [(u, 0, 1.0), (u, 0, -1.0), (v, 1, 1.0), (v, 1, -1.0)].map(|(a, k, sign)| {
        let mut normal = DVec3::ZERO;
        (normal[a], normal[axis]) = (sign, -sign * slopes.shift[k] - slopes.half[k] * slopes.growth[k]);
        let mut on_it = DVec3::ZERO;
        on_it[a] = sign * slopes.half[k];
        Plane::new(normal, origin - on_it)
    })
}

/// A double cone with an elliptic section, perhaps slanted; or a cylinder. In coordinates in which a point is inside
/// where a^2 + b^2 <= s^2, s being 1 in the middle of the frustum: the other nappe, where s is less than 0, is beyond
/// its ends.
#[derive(Clone, Copy)]
pub struct Cone {
    axes: [usize; 3],
    /// What a, b and s grow by for a unit along the three axes: a by the first and the last, b by the second and the last,
    /// s by the last.
    across: [f64; 2],
    along: [f64; 3],
    /// The eye's a, b and s.
    eye: [f64; 3],
    /// a^2 + b^2 - s^2 of the eye: less than 0 inside the double cone.
    outside: f64,
    inverse: f64,
}

impl Cone {
    pub fn new(slopes: &Slopes, axis: usize, origin: DVec3) -> Self {
        let (u, v) = cross_axes(axis);
        let across = slopes.inverse;
        let along = [-slopes.shift[0] * across[0], -slopes.shift[1] * across[1], slopes.growth[0]];
        let (ou, ov, ow) = (origin[u], origin[v], origin[axis]);
        let eye = [ou * across[0] + ow * along[0], ov * across[1] + ow * along[1], 1.0 + ow * along[2]];
        let outside = eye[0] * eye[0] + eye[1] * eye[1] - eye[2] * eye[2];
        let inverse = 1.0 / if outside == 0.0 { NO_DISTANCE } else { outside };
        Self { axes: [u, v, axis], across, along, eye, outside, inverse }
    }

    /// Clips rays by the nappe that the frustum is in; the other one is left to the frustum's ends.
    ///
    /// At nearness w it is inside where outside w^2 + 2 qb w + qa <= 0. The roots are found without cancellation: an eye
    /// is often close to the mantle, prolonged, of a frustum in a stack.
    #[inline(always)]
    pub fn clip(&self, direction: &[Lanes; 3], start: &mut Lanes, end: &mut Lanes) {
        let [u, v, w] = self.axes;
        let (du, dv, dw) = (&direction[u], &direction[v], &direction[w]);
        for r in 0..RAYS {
            let a = du[r] * self.across[0] + dw[r] * self.along[0];
            let b = dv[r] * self.across[1] + dw[r] * self.along[1];
            let s = dw[r] * self.along[2];
            let (qa, qb) = (a * a + b * b - s * s, self.eye[0] * a + self.eye[1] * b - self.eye[2] * s);
            let discriminant = qb * qb - qa * self.outside;
            let misses = discriminant <= 0.0;
            let root = if misses { 0.0 } else { discriminant }.sqrt();
            let sum = -(qb + root.copysign(qb));
            let (one, other) = (sum * self.inverse, qa / sum);
            let (far, near) = (less(one, other), greater(one, other));
            if self.outside > 0.0 {
                start[r] = less(if misses { 0.0 } else { near }, start[r]);
                end[r] = greater(far, end[r]);
            } else if self.eye[2] > 0.0 {
                end[r] = greater(near, end[r]);
            } else {
                // The eye is in the other nappe: what it sees of this one begins where a ray meets it, and has no end.
                start[r] = less(far, start[r]);
            }
        }
    }

    /// The gradient, turned towards the eye, at all points that are left in `nearness`.
    #[inline(always)]
    pub fn normals(&self, direction: &[Lanes; 3], nearness: &Lanes, normals: &mut [Lanes; 3]) {
        let [u, v, w] = self.axes;
        let (du, dv, dw) = (&direction[u], &direction[v], &direction[w]);
        for r in 0..RAYS {
            let at = nearness[r];
            let a = self.eye[0] * at + du[r] * self.across[0] + dw[r] * self.along[0];
            let b = self.eye[1] * at + dv[r] * self.across[1] + dw[r] * self.along[1];
            let s = self.eye[2] * at + dw[r] * self.along[2];
            let (nu, nv) = (a * self.across[0], b * self.across[1]);
            let nw = a * self.along[0] + b * self.along[1] - s * self.along[2];
            // At an apex there is no gradient; a ray through it is one of none.
            let unit = 1.0 / greater((nu * nu + nv * nv + nw * nw).sqrt(), NO_DISTANCE);
            let unit = if nu * du[r] + nv * dv[r] + nw * dw[r] > 0.0 { -unit } else { unit };
            let here = at > 0.0;
            normals[u][r] = if here { nu * unit } else { normals[u][r] };
            normals[v][r] = if here { nv * unit } else { normals[v][r] };
            normals[w][r] = if here { nw * unit } else { normals[w][r] };
        }
    }
}
