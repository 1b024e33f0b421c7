//! The paper's shape grammar (section 4.1): cuboids and cylinders grown onto each other, symmetric about z = 0.
//!
//! Only sums, products and comparisons of 64-bit floats are used, so a seed's shapes are bit-identical on every
//! machine.

use crate::csg::{Kind, Primitive, Shape};
use crate::error::CoreError;
use crate::random::Random;
use crate::voxel::{BitGrid, CELLS, SIDE};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Every amplitude and count of the grammar. Pairs are ranges that are drawn from evenly; sizes are relative to
/// each other only, since the finished shape is scaled to the world grid.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct GrammarConfig {
    /// Least and most growth steps, the first primitive included; mirrored copies are not counted.
    pub steps: [usize; 2],
    /// Share of cylinders.
    pub cylinders: f64,
    /// Share of subtracted primitives.
    pub subtracted: f64,
    /// Half sizes of the first primitive.
    pub first_half: [f64; 2],
    /// Half sizes of the others.
    pub half: [f64; 2],
    /// Chance that a primitive is displaced along its face, in each of the two directions.
    pub displaced: f64,
    /// Largest such displacement, in half sizes of the primitive that it is placed on.
    pub displacement: f64,
    /// Deepest overlap with that primitive, in half sizes of the smaller.
    pub overlap: f64,
    /// How far a subtracted primitive's centre lies from the face, in its own half sizes.
    pub sink: f64,
    /// The world grid covers this much of the largest side: the paper's 120 %.
    pub cover: f64,
    /// Least share of the world grid that is occupied.
    pub min_occupancy: f64,
    /// Smallest extent along any axis, in voxels.
    pub min_extent: usize,
    /// How often to try before giving up.
    pub attempts: u32,
}

impl Default for GrammarConfig {
    fn default() -> Self {
        Self {
            steps: [2, 10],
            cylinders: 0.4,
            subtracted: 0.33,
            first_half: [0.1, 0.4],
            half: [0.03, 0.25],
            displaced: 0.5,
            displacement: 0.9,
            overlap: 0.2,
            sink: 0.1,
            cover: 1.2,
            min_occupancy: 0.01,
            min_extent: 8,
            attempts: 1000,
        }
    }
}

impl GrammarConfig {
    /// Says which entry no shape could be drawn with.
    pub fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(format!("grammar.{message}")));
        let range = |[from, to]: [f64; 2]| from > 0.0 && from <= to && to.is_finite();
        let share = |v: f64| (0.0..=1.0).contains(&v);
        let amplitude = |v: f64| v >= 0.0 && v.is_finite();
        match self {
            c if !(1..=c.steps[1]).contains(&c.steps[0]) => bad("steps must be [least, most], from 1"),
            c if c.steps[1] > 500 => bad("steps must be at most 500"),
            c if !(share(c.cylinders) && share(c.subtracted) && share(c.displaced)) => {
                bad("cylinders, subtracted and displaced are shares between 0 and 1")
            }
            c if !(range(c.first_half) && range(c.half)) => {
                bad("first_half and half must be [least, most], more than 0")
            }
            c if !(amplitude(c.displacement) && amplitude(c.overlap) && amplitude(c.sink)) => {
                bad("displacement, overlap and sink must be 0 or more")
            }
            c if !(c.cover >= 1.0 && c.cover.is_finite()) => bad("cover must be at least 1"),
            c if !(0.0..1.0).contains(&c.min_occupancy) => bad("min_occupancy must lie in [0, 1)"),
            c if c.min_extent >= SIDE => bad("min_extent must be less than 64"),
            c if c.attempts == 0 => bad("attempts must be at least 1"),
            _ => Ok(()),
        }
    }

    /// Draws shapes until one is acceptable: one piece, not empty, not dust.
    pub fn draw(&self, random: &mut Random) -> Result<(Shape, BitGrid), CoreError> {
        for _ in 0..self.attempts {
            let grown = Shape::new(self.grow(random))?;
            if let Some(accepted) = self.scale(grown) {
                return Ok(accepted);
            }
        }
        let attempts = self.attempts;
        Err(CoreError::NoShape { attempts })
    }

    fn grow(&self, random: &mut Random) -> Vec<Primitive> {
        let steps = self.steps[0] + random.below(self.steps[1] - self.steps[0] + 1);
        let mut shape = vec![self.primitive(self.first_half, true, random)];
        for _ in 1..steps {
            let additive = !random.chance(self.subtracted);
            let mut new = self.primitive(self.half, additive, random);
            let faces: Vec<Primitive> = shape.iter().filter(|p| p.additive).copied().collect();
            self.place(&mut new, &faces[random.below(faces.len())], random);
            shape.push(new);
            if new.center.z != 0.0 {
                shape.push(new.mirrored());
            }
        }
        shape
    }

    fn primitive(&self, half: [f64; 2], additive: bool, random: &mut Random) -> Primitive {
        let mut half = DVec3::from([(); 3].map(|()| random.between(half)));
        let mut kind = Kind::Cuboid;
        if random.chance(self.cylinders) {
            let axis = random.below(3);
            kind = Kind::Cylinder { axis };
            half[(axis + 1) % 3] = half[(axis + 2) % 3];
        }
        let center = DVec3::ZERO;
        Primitive { kind, additive, center, half }
    }

    /// Puts a primitive on a random face of another, displaced along it, in touch with it.
    fn place(&self, new: &mut Primitive, on: &Primitive, random: &mut Random) {
        let axis = random.below(3);
        let sign = if random.chance(0.5) { 1.0 } else { -1.0 };
        new.center = on.center;
        for along in [(axis + 1) % 3, (axis + 2) % 3] {
            if random.chance(self.displaced) {
                new.center[along] += random.around(self.displacement) * on.half[along];
            }
        }
        let outwards = if new.additive {
            new.half[axis] - random.unit() * self.overlap * new.half[axis].min(on.half[axis])
        } else {
            random.around(self.sink) * new.half[axis]
        };
        new.center[axis] += sign * (on.half[axis] + outwards);
    }

    /// Centres and scales by the 120 % rule; `None` for what is empty, in pieces, or dust.
    fn scale(&self, mut shape: Shape) -> Option<(Shape, BitGrid)> {
        let (mut lo, mut hi) = shape.bounds();
        // A cut may have taken away what reached furthest: then the bounds are those of the voxels left.
        for _ in 0..4 {
            let scale = 1.0 / (self.cover * (hi - lo).max_element());
            shape = shape.moved(0.5 * (lo + hi), scale);
            let expected = (hi - lo) * scale;
            let grid = BitGrid::of_shape(&shape);
            let bounds = grid.bounds()?;
            let edge = |i: usize| i as f64 / SIDE as f64 - 0.5;
            (lo, hi) = (DVec3::from(bounds.map(|b| edge(b.0))), DVec3::from(bounds.map(|b| edge(b.1 + 1))));
            // Within a voxel of what was expected on either side, the exact bounds stand.
            let tolerance = 2.0 / SIDE as f64;
            if (expected - (hi - lo)).abs().max_element() <= tolerance {
                let extents = bounds.map(|b| b.1 + 1 - b.0);
                let acceptable = extents.iter().all(|&e| e >= self.min_extent)
                    && f64::from(grid.count()) >= self.min_occupancy * CELLS as f64
                    && grid.is_connected();
                return acceptable.then_some((shape, grid));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_symmetric_connected_and_scaled() {
        let config = GrammarConfig::default();
        for sample in 0..200 {
            let (shape, grid) = config.draw(&mut Random::new(7, sample, 0)).unwrap();
            assert!(grid.is_connected());
            let bounds = grid.bounds().unwrap();
            let largest = bounds.iter().map(|b| b.1 + 1 - b.0).max().unwrap();
            assert!((50..=56).contains(&largest), "sample {sample}: {largest} of 64 voxels");
            let mut bytes = vec![0; CELLS];
            grid.write_bytes(&mut bytes);
            assert!(bytes.chunks(SIDE).all(|column| column.iter().eq(column.iter().rev())));
            assert_eq!(config.draw(&mut Random::new(7, sample, 0)).unwrap().0, shape);
        }
    }

    #[test]
    fn impossible_wishes_are_refused() {
        let with = |change: fn(&mut GrammarConfig)| {
            let mut config = GrammarConfig::default();
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        assert!(with(|c| c.steps = [3, 2]).contains("steps"));
        assert!(with(|c| c.half = [0.0, 1.0]).contains("half"));
        assert!(with(|c| c.cylinders = 1.5).contains("between 0 and 1"));
        assert!(with(|c| c.cover = f64::NAN).contains("cover"));
        let hopeless = GrammarConfig { min_occupancy: 0.9, attempts: 5, ..GrammarConfig::default() };
        let error = hopeless.draw(&mut Random::new(0, 0, 0)).unwrap_err();
        assert_eq!(error, CoreError::NoShape { attempts: 5 });
    }
}
