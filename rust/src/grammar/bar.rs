//! A bar of hexagonal or octagonal section, as regular as turned and milled parts are: a nut, a bolt's head, a pencil.

use super::{BARS, edge_of, is_inner, is_range, is_share};
use crate::csg::{Frustum, Kind, Primitive, cross_axes};
use crate::error::CoreError;
use crate::random::Random;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How often shapes begin with a bar, and what it is like; sizes relative to those of the other primitives.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct BarConfig {
    /// Share of the shapes that begin with a bar, of those that begin with no sheet.
    pub share: f64,
    /// Share of these that nothing is added to.
    pub alone: f64,
    /// From the axis to a corner of the section.
    pub radius: [f64; 2],
    /// Half the length, in radii.
    pub half_length: [f64; 2],
    /// Share of the bars with a round hole from end to end.
    pub bored: f64,
    /// Width of the hole, as a share of the section's, from face to face.
    pub bore: [f64; 2],
    /// Share of the bars whose corners are turned off at one end or at both, as a nut's are.
    pub turned: f64,
    /// Radius of the end that is left, in radii, and how far back that begins, in what is lost of the radius.
    pub end: [f64; 2],
    pub slope: [f64; 2],
}

impl Default for BarConfig {
    fn default() -> Self {
        Self {
            share: 0.0,
            alone: 0.5,
            radius: [0.2, 0.4],
            half_length: [0.2, 1.5],
            bored: 0.75,
            bore: [0.35, 0.75],
            turned: 0.5,
            end: [0.6, 0.95],
            slope: [0.4, 1.2],
        }
    }
}

impl BarConfig {
    /// Says which entry no bar could be drawn with.
    pub fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(format!("grammar.bars.{message}")));
        match self {
            c if ![c.share, c.alone, c.bored, c.turned].into_iter().all(is_share) => {
                bad("share, alone, bored and turned are shares between 0 and 1")
            }
            c if !(is_range(c.radius) && is_range(c.half_length) && is_range(c.slope)) => {
                bad("radius, half_length and slope must be [least, most], more than 0")
            }
            c if !(is_inner(c.bore) && is_inner(c.end)) => {
                bad("bore and end must be [least, most], between 0 and 1")
            }
            _ => Ok(()),
        }
    }

    /// The primitives of one bar about the origin: what is turned, what is milled off it, and the hole.
    pub fn draw(&self, random: &mut Random) -> Vec<Primitive> {
        let (axis, section) = (random.below(3), BARS[random.below(BARS.len())]);
        let radius = random.between(self.radius);
        let length = radius * random.between(self.half_length);
        let mut bar = self.turn(axis, radius, length, random);
        let (u, v) = cross_axes(axis);
        // Half the box around the section, whose corners' cuts leave so much of each side: what is left ends on the circle.
        let [p, q] = section.map(|cut| (1.0 - 2.0 * cut) * (1.0 - 2.0 * cut));
        let flats =
            [radius * ((1.0 - q) / (1.0 - p * q)).sqrt(), radius * ((1.0 - p) / (1.0 - p * q)).sqrt()];
        let mut around = Primitive {
            kind: Kind::Cuboid,
            additive: false,
            center: DVec3::ZERO,
            half: DVec3::splat(length),
        };
        (around.half[u], around.half[v]) = (flats[0], flats[1]);
        for (a, flat, across) in [(u, flats[0], v), (v, flats[1], u)] {
            let beyond = 0.5 * (radius - flat);
            if beyond <= 1e-9 * radius {
                continue; // corners, and no faces, that way
            }
            for sign in [1.0, -1.0] {
                let mut side = around;
                (side.half[a], side.half[across]) = (beyond, radius);
                side.center[a] = sign * (flat + beyond);
                bar.push(side);
            }
        }
        let corners = [[1, 1], [1, -1], [-1, 1], [-1, -1]];
        bar.extend(corners.map(|corner| edge_of(around, axis, corner, section)));
        if random.chance(self.bored) {
            let hole = flats[0].min(flats[1]) * random.between(self.bore);
            (around.half[u], around.half[v]) = (hole, hole);
            bar.push(Primitive { kind: Kind::Cylinder { axis }, ..around });
        }
        bar
    }

    /// A cylinder about the origin, its ends smaller where they are turned; along z both or none, for it is symmetric.
    fn turn(&self, axis: usize, radius: f64, length: f64, random: &mut Random) -> Vec<Primitive> {
        let mut ends = Vec::new();
        if random.chance(self.turned) {
            let which = if axis == 2 { 0 } else { random.below(3) };
            ends = [&[1.0, -1.0][..], &[1.0], &[-1.0]][which].to_vec();
        }
        let left = random.between(self.end);
        let deep = ((1.0 - left) * radius * random.between(self.slope)).min(0.9 * length);
        let round = |kind, from: f64, to: f64, radius: f64| {
            let (mut center, mut half) = (DVec3::ZERO, DVec3::splat(radius));
            (center[axis], half[axis]) = (0.5 * (from + to), 0.5 * (to - from));
            Primitive { kind, additive: true, center, half }
        };
        let short = |sign| if ends.contains(&sign) { length - deep } else { length };
        let mut parts = vec![round(Kind::Cylinder { axis }, -short(-1.0), short(1.0), radius)];
        for &sign in &ends {
            let taper = [-sign * (1.0 - left) / (1.0 + left); 2];
            let kind = Kind::Frustum(Frustum { axis, round: true, shear: [0.0; 2], taper });
            let (near, far) = (sign * (length - deep), sign * length);
            parts.push(round(kind, near.min(far), near.max(far), 0.5 * (1.0 + left) * radius));
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::Shape;
    use std::f64::consts::{FRAC_PI_8, PI};

    /// A bar, its axis, its radius and half its length.
    fn drawn(config: &BarConfig, sample: u64) -> (Shape, usize, f64, f64) {
        let bar = config.draw(&mut Random::new(9, sample, 0));
        let Kind::Cylinder { axis } = bar[0].kind else { panic!("a bar is turned first") };
        let (u, _) = cross_axes(axis);
        let half = bar.iter().find(|p| !p.additive).unwrap().half[axis];
        (Shape::new(bar.clone()).unwrap(), axis, bar[0].half[u], half)
    }

    fn at(axis: usize, along: f64, reach: f64, angle: f64) -> DVec3 {
        let (u, v) = cross_axes(axis);
        let mut point = DVec3::ZERO;
        (point[axis], point[u], point[v]) = (along, reach * angle.cos(), reach * angle.sin());
        point
    }

    #[test]
    fn sections_are_regular() {
        let config = BarConfig { turned: 0.0, bored: 0.0, ..BarConfig::default() };
        let mut sections = [0; 3];
        for sample in 0..100 {
            let (shape, axis, radius, half) = drawn(&config, sample);
            let reach = |angle: f64| {
                let steps = (0..2000).take_while(|&i| {
                    shape.contains(at(axis, 0.7 * half, radius * f64::from(i) / 1999.5, angle))
                });
                steps.count() as f64 / 2000.0
            };
            // A regular polygon of n sides reaches cos(pi / n) / cos(angle from the middle of a side).
            let polygon = |n: f64, first: f64, angle: f64| {
                (PI / n).cos() / ((angle - first).rem_euclid(2.0 * PI / n) - PI / n).cos()
            };
            let fits = [(6.0, 0.0), (6.0, PI / 6.0), (8.0, FRAC_PI_8)].map(|(n, first)| {
                (0..90).all(|i| {
                    let angle = 0.013 + f64::from(i) * PI / 45.0;
                    (reach(angle) - polygon(n, first, angle)).abs() < 0.002
                })
            });
            assert_eq!(fits.iter().filter(|&&fit| fit).count(), 1, "sample {sample}");
            sections[fits.iter().position(|&fit| fit).unwrap()] += 1;
        }
        assert!(sections.iter().all(|&n| n > 15), "{sections:?}");
    }

    #[test]
    fn ends_are_turned_and_holes_go_through() {
        let config =
            BarConfig { turned: 1.0, bored: 1.0, end: [0.7; 2], slope: [0.5; 2], ..BarConfig::default() };
        config.check().unwrap();
        let mut seen = [0; 3];
        for sample in 0..100 {
            let (shape, axis, radius, half) = drawn(&config, sample);
            assert!((-9..=9).all(|i| !shape.contains(at(axis, 0.11 * f64::from(i) * half, 0.0, 0.0))));
            let flat = 0.866 * radius;
            assert!((0..6).any(|i| shape.contains(at(axis, 0.0, 0.97 * flat, f64::from(i) * PI / 6.0))));
            let widest = |along: f64| {
                let reaches = (0..72).map(|i| {
                    let inside = |step: &i32| {
                        let reach = radius * f64::from(*step) / 499.5;
                        shape.contains(at(
                            axis,
                            along,
                            reach,
                            f64::from(i) * PI / 36.0 + PI / 8.0 * f64::from(i % 2),
                        ))
                    };
                    (0..500).rev().find(inside).map_or(0.0, |step| f64::from(step) / 500.0)
                });
                reaches.fold(0.0, f64::max)
            };
            let turned = [1.0, -1.0].map(|sign| widest(sign * 0.999 * half) < 0.72);
            assert!(widest(0.0) > 0.98 && (turned[0] || turned[1]), "sample {sample}");
            assert!(axis != 2 || turned == [true, true]);
            seen[usize::from(turned[0]) + 2 * usize::from(turned[1]) - 1] += 1;
        }
        assert!(seen.iter().all(|&n| n > 10), "{seen:?}");
    }

    #[test]
    fn impossible_bars_are_refused() {
        let with = |change: fn(&mut BarConfig)| {
            let mut config = BarConfig::default();
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        assert!(with(|c| c.share = 1.5).contains("between 0 and 1"));
        assert!(with(|c| c.radius = [0.0, 1.0]).contains("more than 0"));
        assert!(with(|c| c.bore = [0.5, 1.0]).contains("bore and end"));
    }
}
