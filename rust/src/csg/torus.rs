//! A ring, or an arc of one: handles, hoops, rims.

use super::cross_axes;
use glam::DVec3;

/// Its half sizes are those of the whole ring, which may be an ellipse, as its tube may.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    pub axis: usize,
    /// Half of the tube's width, as a share of the ring's outer half sizes: more than 0, at most one half.
    pub tube: f64,
    /// The arc, in degrees from the first cross axis towards the second, of a ring that is stretched to a circle;
    /// from less than to, by 360 at most. Its ends are cut by planes through the axis.
    pub arc: [f64; 2],
}

impl Torus {
    /// What is wrong with it, if anything.
    pub fn fault(&self) -> Option<&'static str> {
        let [from, to] = self.arc;
        match self {
            t if !(t.tube > 0.0 && t.tube <= 0.5) => Some("tube must be more than 0 and at most 0.5"),
            // A hair more, for who adds 360 to a number.
            _ if !(from.abs() <= 720.0 && to > from && to - from <= 360.0 + 1e-9) => {
                Some("arc must be [from, to] in degrees, from less than to, by 360 at most")
            }
            _ => None,
        }
    }

    /// Lower and upper corner of the box around it, from its centre.
    pub fn corners(&self, half: DVec3) -> (DVec3, DVec3) {
        let (u, v) = cross_axes(self.axis);
        let (mut lo, mut hi) = (-half, half);
        let [from, to] = self.arc;
        let ends = [from, to].map(direction);
        // The arc reaches as far as the whole ring where it comes by an axis, else as far as its ends do.
        let passes = |degrees: f64| (degrees - from).rem_euclid(360.0) <= to - from;
        let inner = 1.0 - 2.0 * self.tube;
        for (a, at, part) in [(u, 0.0, ends.map(|e| e[0])), (v, 90.0, ends.map(|e| e[1]))] {
            let most = part[0].max(part[1]);
            let least = part[0].min(part[1]);
            hi[a] = half[a] * if passes(at) { 1.0 } else { most.max(most * inner) };
            lo[a] = half[a] * if passes(at + 180.0) { -1.0 } else { least.min(least * inner) };
        }
        (lo, hi)
    }

    pub fn mirrored(mut self) -> Self {
        if self.axis < 2 {
            self.arc = [-self.arc[1], -self.arc[0]];
        }
        self
    }

    /// The same, of a ring that is stretched to a circle of radius 1.
    #[inline(always)]
    pub fn ring(&self, half: DVec3) -> Ring {
        let (u, v) = cross_axes(self.axis);
        let middle = 1.0 - self.tube;
        let turn = self.arc[1] - self.arc[0];
        Ring {
            scale: [1.0 / half[u], 1.0 / half[v], self.tube / half[self.axis]],
            around: 4.0 * middle * middle,
            rest: middle * middle - self.tube * self.tube,
            ends: self.arc.map(direction),
            span: match turn {
                t if t >= 360.0 => Span::Whole,
                t if t > 180.0 => Span::Most,
                _ => Span::Part,
            },
        }
    }
}

/// Cosine and sine of an angle in degrees, by sums and products alone: the same on every machine.
fn direction(degrees: f64) -> [f64; 2] {
    let turns = (degrees.abs() / 90.0).round();
    let x = (degrees.abs() - 90.0 * turns) * (std::f64::consts::PI / 180.0);
    // The terms of the two series; the last are less than a rounding.
    let (mut sine, mut cosine, mut term) = (x, 1.0, x);
    for k in 1..10 {
        term *= x / f64::from(2 * k);
        cosine += if k % 2 == 1 { -term } else { term };
        term *= x / f64::from(2 * k + 1);
        sine += if k % 2 == 1 { -term } else { term };
    }
    let [cosine, sine] = match turns as i64 % 4 {
        0 => [cosine, sine],
        1 => [-sine, cosine],
        2 => [-cosine, -sine],
        _ => [sine, -cosine],
    };
    [cosine, if degrees < 0.0 { -sine } else { sine }]
}

/// How much of a ring there is: all of it, more than half, or half at most.
#[derive(Clone, Copy, PartialEq)]
pub enum Span {
    Whole,
    Most,
    Part,
}

/// A ring stretched so that its tube, of radius `tube`, has its middle on a circle of radius 1 - `tube`.
#[derive(Clone, Copy)]
pub struct Ring {
    /// What offsets along the two cross axes and its own are multiplied by.
    pub scale: [f64; 3],
    /// Four times the square of the circle's radius, and the difference of the squares of the two radii.
    pub around: f64,
    pub rest: f64,
    /// Directions of the arc's ends.
    pub ends: [[f64; 2]; 2],
    pub span: Span,
}

impl Ring {
    /// Whether it holds a point this far from its centre, along the two cross axes and its own.
    #[inline(always)]
    pub fn hold(&self, [du, dv, along]: [f64; 3]) -> bool {
        let (a, b, c) = (du * self.scale[0], dv * self.scale[1], along * self.scale[2]);
        let flat = a * a + b * b;
        let sum = flat + c * c + self.rest;
        let [[from_a, from_b], [to_a, to_b]] = self.ends;
        let (after, before) = (from_a * b - from_b * a >= 0.0, to_a * b - to_b * a <= 0.0);
        let within = match self.span {
            Span::Whole => true,
            Span::Most => after | before,
            Span::Part => after & before,
        };
        (sum * sum <= self.around * flat) & within
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_cosines_and_sines() {
        for k in -1440..=1440 {
            let degrees = f64::from(k) * 0.5;
            let ([cosine, sine], (s, c)) = (direction(degrees), degrees.to_radians().sin_cos());
            assert!((cosine - c).abs() < 1e-14 && (sine - s).abs() < 1e-14, "{degrees}: {cosine} {sine}");
            let [again, opposite] = direction(-degrees);
            assert!(again == cosine && opposite == -sine);
        }
    }

    #[test]
    fn a_box_is_as_large_as_its_arc() {
        let half = DVec3::new(0.4, 0.5, 0.1);
        for (from, turn) in [(0.0, 360.0), (-90.0, 180.0), (20.0, 50.0), (100.0, 300.0), (-170.0, 30.0)] {
            let torus = Torus { axis: 2, tube: 0.2, arc: [from, from + turn] };
            let (ring, (lo, hi)) = (torus.ring(half), torus.corners(half));
            let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for x in -200..=200 {
                for y in -250..=250 {
                    let at = DVec3::new(f64::from(x), f64::from(y), 0.0) * 0.002;
                    if ring.hold(at.to_array()) {
                        (least, most) = (least.min(at), most.max(at));
                    }
                }
            }
            for a in 0..2 {
                assert!((least[a] - lo[a]).abs() < 0.005 && (most[a] - hi[a]).abs() < 0.005, "{from} {turn}");
            }
        }
    }
}
