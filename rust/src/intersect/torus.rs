//! Tori: a quartic along each ray, which it meets in up to two stretches; the gap of an arc may cut one of them in two.

#![expect(clippy::needless_range_loop, reason = "loops over the rays of a tile index many arrays at once")]

use super::plane::Plane;
use super::{Lanes, NEAREST, NO_DISTANCE, RAYS};
use crate::csg::{Ring, Span, Torus, cross_axes};
use glam::DVec3;

/// Stretches in which a ray may be inside.
pub const STRETCHES: usize = 3;

/// A torus as the eye has it.
#[derive(Clone, Copy)]
pub struct Arc {
    ring: Ring,
    /// Radius of the circle that the tube is around, and the square of the hole's.
    middle: f64,
    hole: f64,
    axes: [usize; 3],
    /// The eye, in coordinates in which the ring is round.
    eye: [f64; 3],
    /// The ends, outwards; of an arc of more than half they bound what is missing instead.
    ends: [Plane; 2],
}

impl Arc {
    pub fn new(torus: &Torus, half: DVec3, origin: DVec3) -> Self {
        let (u, v) = cross_axes(torus.axis);
        let ring = torus.ring(half);
        let axes = [u, v, torus.axis];
        // Outwards of the arc that goes on counterclockwise from the first end, clockwise from the second.
        let [from, to] = ring.ends;
        let sign = if ring.span == Span::Most { -1.0 } else { 1.0 };
        let end = |normal: [f64; 2]| {
            let mut across = DVec3::ZERO;
            (across[u], across[v]) = (sign * normal[0] * ring.scale[0], sign * normal[1] * ring.scale[1]);
            Plane::new(across, origin)
        };
        let ends = [end([from[1], -from[0]]), end([-to[1], to[0]])];
        let eye = [0, 1, 2].map(|k| origin[axes[k]] * ring.scale[k]);
        let hole = 1.0 - 2.0 * torus.tube;
        Self { ring, middle: 1.0 - torus.tube, hole: hole * hole, axes, eye, ends }
    }

    /// Where rays that are in the box around the ring from `start` to `end` are inside, from the eye on: stretches, and
    /// how many of them any ray has. A ray that has fewer has from 0 to `NEAREST`.
    ///
    /// One ray after the other, so no instruction set would do it faster; and out of the way of what is cast more often.
    #[inline(never)]
    pub fn cross(
        &self,
        direction: &[Lanes; 3],
        start: &Lanes,
        end: &Lanes,
    ) -> ([[Lanes; 2]; STRETCHES], usize) {
        let mut found = [[[0.0; RAYS], [NEAREST; RAYS]]; STRETCHES];
        let mut most = 0;
        for r in 0..RAYS {
            if start[r] <= end[r] {
                continue;
            }
            let mut count = 0;
            let mut keep = |near: f64, far: f64| {
                if near > far && count < STRETCHES {
                    (found[count][0][r], found[count][1][r]) = (near, far);
                    count += 1;
                }
            };
            // Where the ray is between the two ends, or in the gap.
            let (mut near, mut far) = (NEAREST, 0.0);
            for plane in &self.ends {
                let at = plane.meets(direction, r);
                if plane.eye_is_inside() {
                    far = at.max(far);
                } else {
                    near = at.min(near);
                }
            }
            if self.ring.span == Span::Part && start[r].min(near) <= end[r].max(far) {
                continue;
            }
            for [from, to] in self.stretches(direction, r, start[r], end[r]).into_iter().flatten() {
                match self.ring.span {
                    Span::Whole => keep(from, to),
                    Span::Part => keep(from.min(near), to.max(far)),
                    Span::Most if near > far => {
                        keep(from, to.max(near));
                        keep(from.min(far), to);
                    }
                    Span::Most => keep(from, to),
                }
            }
            most = count.max(most);
        }
        (found, most)
    }

    /// The stretches of one ray inside the whole ring.
    #[inline(always)]
    fn stretches(&self, direction: &[Lanes; 3], r: usize, start: f64, end: f64) -> [Option<[f64; 2]>; 2] {
        let along = [0, 1, 2].map(|k| direction[self.axes[k]][r] * self.ring.scale[k]);
        let (mut first, mut last) = (1.0 / start, 1.0 / end);
        // All of the ring is within a circle of radius 1, and none of it near the axis.
        let (da, db, [a, b, _]) = (along[0], along[1], self.eye);
        let (qa, qb, qc) = (da * da + db * db, a * da + b * db, a * a + b * b - 1.0);
        let root = (qb * qb - qa * qc).max(0.0).sqrt();
        if qa > 1e-12 {
            first = first.max((-qb - root) / qa);
            last = last.min((-qb + root) / qa);
        }
        let flat = |t: f64| qa * t * t + 2.0 * qb * t + qc + 1.0;
        if first >= last || flat(first).max(flat(last)) < self.hole {
            return [None; 2];
        }
        // The part that is left, with x from -1 to 1 along it: a^2 + b^2 is a polynomial of x, and so is the sum.
        let (middle, reach) = (0.5 * (first + last), 0.5 * (last - first));
        let ray = [0, 1, 2].map(|k| [self.eye[k] + along[k] * middle, along[k] * reach]);
        let square = |[p, q]: [f64; 2]| [p * p, 2.0 * p * q, q * q];
        let [a, b, c] = ray.map(square);
        let flat = [0, 1, 2].map(|k| a[k] + b[k]);
        let sum = [flat[0] + c[0] + self.ring.rest, flat[1] + c[1], flat[2] + c[2]];
        let around = self.ring.around;
        let outside = [
            sum[0] * sum[0] - around * flat[0],
            2.0 * sum[0] * sum[1] - around * flat[1],
            2.0 * sum[0] * sum[2] + sum[1] * sum[1] - around * flat[2],
            2.0 * sum[1] * sum[2],
            sum[2] * sum[2],
        ];
        let (roots, count) = roots(&outside);
        let mut found = [None; 2];
        let mut number = 0;
        let mut from = -1.0;
        for k in 0..=count {
            let to = if k < count { roots[k] } else { 1.0 };
            if number < 2 && value(&outside, 0.5 * (from + to)) < 0.0 {
                found[number] = Some([1.0 / (middle + reach * from), 1.0 / (middle + reach * to)]);
                number += 1;
            }
            from = to;
        }
        found
    }

    /// Unit normals, turned towards the eye, at all points that are left in `nearness`.
    #[inline(never)]
    pub fn normals(&self, direction: &[Lanes; 3], mut nearness: Lanes, normals: &mut [Lanes; 3]) {
        if self.ring.span != Span::Whole {
            for plane in &self.ends {
                plane.normals(direction, &mut nearness, normals);
            }
        }
        let [u, v, w] = self.axes;
        let [su, sv, sw] = self.ring.scale;
        for r in 0..RAYS {
            let at = nearness[r];
            let (du, dv, dw) = (direction[u][r], direction[v][r], direction[w][r]);
            let (a, b, c) =
                (self.eye[0] * at + du * su, self.eye[1] * at + dv * sv, self.eye[2] * at + dw * sw);
            // Away from the nearest point of the circle that the tube is around.
            let inwards = 1.0 - self.middle * at / (a * a + b * b).sqrt().max(NO_DISTANCE);
            let (nu, nv, nw) = (a * inwards * su, b * inwards * sv, c * sw);
            let unit = 1.0 / (nu * nu + nv * nv + nw * nw).sqrt().max(NO_DISTANCE);
            let unit = if nu * du + nv * dv + nw * dw > 0.0 { -unit } else { unit };
            let here = at > 0.0;
            normals[u][r] = if here { nu * unit } else { normals[u][r] };
            normals[v][r] = if here { nv * unit } else { normals[v][r] };
            normals[w][r] = if here { nw * unit } else { normals[w][r] };
        }
    }
}

/// A polynomial's value; coefficients from the constant on.
#[inline(always)]
fn value<const N: usize>(p: &[f64; N], x: f64) -> f64 {
    let mut y = p[N - 1];
    for k in (0..N - 1).rev() {
        y = y * x + p[k];
    }
    y
}

/// The roots of a quartic in -1 .. 1 at which it changes its sign, ascending: between those of its derivative, which
/// lie between those of the derivative's.
#[inline(always)]
fn roots(p: &[f64; 5]) -> ([f64; 4], usize) {
    let first = [p[1], 2.0 * p[2], 3.0 * p[3], 4.0 * p[4]];
    let second = [first[1], 2.0 * first[2], 3.0 * first[3]];
    let (bends, count) = parabola(&second);
    let (turns, count) = between::<4, 3, 2>(&first, &bends, count);
    between::<5, 4, 3>(p, &turns, count)
}

#[inline(always)]
fn parabola(p: &[f64; 3]) -> ([f64; 2], usize) {
    let discriminant = p[1] * p[1] - 4.0 * p[0] * p[2];
    if discriminant <= 0.0 {
        return ([0.0; 2], 0);
    }
    let sum = -0.5 * (p[1] + discriminant.sqrt().copysign(p[1]));
    let (one, other) = (sum / p[2], p[0] / sum);
    ([one.min(other), one.max(other)], 2)
}

/// The roots in -1 .. 1 of a polynomial that rises or falls all along between some places.
#[inline(always)]
fn between<const N: usize, const ROOTS: usize, const PLACES: usize>(
    p: &[f64; N],
    places: &[f64; PLACES],
    count: usize,
) -> ([f64; ROOTS], usize) {
    let (mut roots, mut number) = ([0.0; ROOTS], 0);
    let mut from = -1.0;
    let mut at_from = value(p, from);
    for k in 0..=count {
        let to = if k < count { places[k].clamp(from, 1.0) } else { 1.0 };
        let at_to = value(p, to);
        if (at_from < 0.0) != (at_to < 0.0) && number < ROOTS {
            // Places between roots need not be as exact as the last roots.
            let exact = if N == 5 { 1e-15 } else { 1e-8 };
            roots[number] = root(p, from, to, at_from < 0.0, exact);
            number += 1;
        }
        (from, at_from) = (to, at_to);
    }
    (roots, number)
}

/// The root between two places, by Newton's steps where they stay between them, else by halving.
#[inline(always)]
fn root<const N: usize>(p: &[f64; N], mut from: f64, mut to: f64, rises: bool, exact: f64) -> f64 {
    let mut x = 0.5 * (from + to);
    for _ in 0..100 {
        let (mut y, mut slope) = (p[N - 1], 0.0);
        for k in (0..N - 1).rev() {
            slope = slope * x + y;
            y = y * x + p[k];
        }
        if (y < 0.0) == rises {
            from = x;
        } else {
            to = x;
        }
        let next = x - y / slope;
        if (next - x).abs() <= exact || to - from <= exact {
            return x;
        }
        x = if next > from && next < to { next } else { 0.5 * (from + to) };
    }
    x
}
