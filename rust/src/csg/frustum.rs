//! A prism whose section moves and grows evenly along its axis: a slanted leg, a cone; stacked, any profile turned about
//! an axis.

use super::cross_axes;
use glam::DVec3;

/// Its half sizes are those of the section in the middle. The section is a rectangle, or an ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    pub axis: usize,
    pub round: bool,
    /// How far the upper end's centre lies from the middle's along the two cross axes; the lower end's lies as far the
    /// other way.
    pub shear: [f64; 2],
    /// The upper end is so much larger than the middle along the two cross axes, as a share of it, and the lower end
    /// so much smaller: -1 to 1. A round one has the same along both.
    pub taper: [f64; 2],
}

impl Frustum {
    /// What is wrong with it, if anything.
    pub fn fault(&self) -> Option<&'static str> {
        match self {
            f if !f.shear.iter().chain(&f.taper).all(|v| v.is_finite()) => {
                Some("shear and taper must be finite")
            }
            f if !f.taper.iter().all(|t| t.abs() <= 1.0) => Some("taper must lie between -1 and 1"),
            f if f.round && f.taper[0] != f.taper[1] => {
                Some("an elliptic section has the same taper along both axes")
            }
            _ => None,
        }
    }

    /// Lower and upper corner of the box around it, from its centre.
    pub fn corners(&self, half: DVec3) -> (DVec3, DVec3) {
        let (u, v) = cross_axes(self.axis);
        let (mut lo, mut hi) = (-half, half);
        for (a, shear, taper) in [(u, self.shear[0], self.taper[0]), (v, self.shear[1], self.taper[1])] {
            let (upper, lower) = (half[a] * (1.0 + taper), half[a] * (1.0 - taper));
            lo[a] = (shear - upper).min(-shear - lower);
            hi[a] = (shear + upper).max(-shear + lower);
        }
        (lo, hi)
    }

    pub fn mirrored(mut self) -> Self {
        let flip = |pair: [f64; 2]| pair.map(|v| -v);
        if self.axis == 2 {
            (self.shear, self.taper) = (flip(self.shear), flip(self.taper));
        } else {
            self.shear[1] = -self.shear[1];
        }
        self
    }

    /// The same, as linear functions of the offset from the centre.
    #[inline(always)]
    pub fn slopes(&self, half: DVec3) -> Slopes {
        let (u, v) = cross_axes(self.axis);
        let along = half[self.axis];
        Slopes {
            half: [half[u], half[v], along],
            inverse: [1.0 / half[u], 1.0 / half[v]],
            shift: self.shear.map(|s| s / along),
            growth: self.taper.map(|t| t / along),
        }
    }
}

/// A frustum's sections: for each unit along the axis the middle moves by `shift`, and sizes grow by a share `growth`.
#[derive(Clone, Copy)]
pub struct Slopes {
    pub half: [f64; 3],
    pub inverse: [f64; 2],
    pub shift: [f64; 2],
    pub growth: [f64; 2],
}

impl Slopes {
    /// Whether it holds a point this far from its centre, along the two cross axes and its own.
    #[inline(always)]
    pub fn hold(&self, round: bool, [du, dv, along]: [f64; 3]) -> bool {
        let (u, v) = (du - self.shift[0] * along, dv - self.shift[1] * along);
        let [grown, grown_too] = self.growth.map(|g| 1.0 + g * along);
        let (a, b) = (u * self.inverse[0], v * self.inverse[1]);
        let within =
            if round { a * a + b * b <= grown * grown } else { (a.abs() <= grown) & (b.abs() <= grown_too) };
        (along.abs() <= self.half[2]) & within
    }
}
