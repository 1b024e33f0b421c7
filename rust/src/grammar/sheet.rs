//! A bent sheet: panels in a chain, each at the end of the one before, such as a chair without legs or a flight of steps.

use super::{beyond_slab, is_range, is_share};
use crate::csg::{Kind, Primitive};
use crate::error::CoreError;
use crate::random::Random;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Counts and sizes of the bent sheets; sizes relative to those of the other primitives.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct SheetConfig {
    /// Share of the shapes that begin with a bent sheet.
    pub share: f64,
    /// Least and most panels.
    pub panels: [usize; 2],
    /// How far a panel goes, along each axis that it goes along.
    pub length: [f64; 2],
    pub thickness: [f64; 2],
    /// Half the width, along z, of the whole sheet.
    pub half_width: [f64; 2],
}

impl Default for SheetConfig {
    fn default() -> Self {
        Self {
            share: 0.0,
            panels: [2, 5],
            length: [0.25, 0.8],
            thickness: [0.05, 0.14],
            half_width: [0.1, 0.4],
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Course {
    Level,
    Upright,
    Slanted,
}

impl SheetConfig {
    /// Says which entry no sheet could be drawn with.
    pub fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(format!("grammar.sheets.{message}")));
        match self {
            c if !is_share(c.share) => bad("share must lie between 0 and 1"),
            c if !(1..=c.panels[1]).contains(&c.panels[0]) || c.panels[1] > 50 => {
                bad("panels must be [least, most], from 1 to 50")
            }
            c if !(is_range(c.length) && is_range(c.thickness) && is_range(c.half_width)) => {
                bad("length, thickness and half_width must be [least, most], more than 0")
            }
            c if c.thickness[1] > 0.6 * c.length[0] => bad("thickness must be at most 0.6 of length"),
            _ => Ok(()),
        }
    }

    /// The panels of one sheet, from the lowest up: level, upright or slanted, never back over the one before.
    pub fn draw(&self, random: &mut Random) -> Vec<Primitive> {
        let panels = self.panels[0] + random.below(self.panels[1] - self.panels[0] + 1);
        let thickness = random.between(self.thickness);
        let half_width = random.between(self.half_width);
        // A cut along a slanted panel takes what was there before it, so those come first.
        let (mut slanted, mut straight) = (Vec::new(), Vec::new());
        let mut course = [Course::Level, Course::Upright, Course::Slanted][random.below(3)];
        let mut from = DVec3::ZERO;
        for _ in 0..panels {
            let side = if random.chance(0.5) { 1.0 } else { -1.0 };
            let mut step = DVec3::ZERO;
            if course != Course::Upright {
                step.x = side * random.between(self.length);
            }
            if course != Course::Level {
                step.y = random.between(self.length);
            }
            let center = from + 0.5 * step;
            let mut half = 0.5 * step.abs();
            half.z = half_width;
            if course == Course::Slanted {
                let side = if step.x > 0.0 { 1 } else { -1 };
                let corner = if random.chance(0.5) { [side, -1] } else { [-side, 1] };
                let wedge = Primitive { kind: Kind::Wedge { axis: 2, corner }, additive: true, center, half };
                // Of the way from the slanted face to the right angle, as much as makes it so thick.
                let share = thickness * step.length() / (step.x * step.y).abs();
                slanted.extend([wedge, beyond_slab(wedge, share.min(0.9))]);
            } else {
                half.x += 0.5 * thickness;
                half.y += 0.5 * thickness;
                straight.push(Primitive { kind: Kind::Cuboid, additive: true, center, half });
            }
            from += step;
            let others = match course {
                Course::Level => [Course::Upright, Course::Slanted],
                Course::Upright => [Course::Level, Course::Slanted],
                Course::Slanted => [Course::Level, Course::Upright],
            };
            course = others[random.below(2)];
        }
        slanted.extend(straight);
        slanted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::Shape;
    use crate::voxel::BitGrid;

    #[test]
    fn a_sheet_is_one_piece_and_as_thin_as_asked() {
        // Few enough panels for each to be thicker than a voxel.
        let (panels, thickness, half_width) = ([2, 3], [0.1; 2], [0.3; 2]);
        let config = SheetConfig { panels, thickness, half_width, ..SheetConfig::default() };
        config.check().unwrap();
        for sample in 0..200 {
            let panels = config.draw(&mut Random::new(5, sample, 0));
            let shape = Shape::new(panels.clone()).unwrap();
            let (lo, hi) = shape.bounds();
            let scaled = shape.moved(0.5 * (lo + hi), 0.9 / (hi - lo).max_element());
            assert!(BitGrid::of_shape(&scaled).is_connected(), "sample {sample}");
            for panel in panels.iter().filter(|p| p.additive) {
                assert_eq!((panel.half.z, panel.center.z), (0.3, 0.0));
                if panel.kind == Kind::Cuboid {
                    assert!((2.0 * panel.half.x.min(panel.half.y) - 0.1).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_slanted_panel_has_the_thickness_across_it() {
        let config = SheetConfig { panels: [1, 1], thickness: [0.1; 2], ..SheetConfig::default() };
        let mut seen = 0;
        for sample in 0..50 {
            let panels = config.draw(&mut Random::new(6, sample, 0));
            let Kind::Wedge { corner, .. } = panels[0].kind else { continue };
            seen += 1;
            let shape = Shape::new(panels.clone()).unwrap();
            let wedge = panels[0];
            let inwards =
                DVec3::new(f64::from(corner[0]) * wedge.half.y, f64::from(corner[1]) * wedge.half.x, 0.0)
                    .normalize();
            assert!(shape.contains(wedge.center + 0.001 * inwards));
            assert!(shape.contains(wedge.center + 0.099 * inwards));
            assert!(!shape.contains(wedge.center - 0.001 * inwards));
            assert!(!shape.contains(wedge.center + 0.101 * inwards));
        }
        assert!(seen > 5);
    }

    #[test]
    fn impossible_sheets_are_refused() {
        let with = |change: fn(&mut SheetConfig)| {
            let mut config = SheetConfig::default();
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        assert!(with(|c| c.share = 1.5).contains("between 0 and 1"));
        assert!(with(|c| c.panels = [0, 2]).contains("from 1 to 50"));
        assert!(with(|c| c.length = [0.0, 1.0]).contains("more than 0"));
        assert!(with(|c| c.thickness = [0.1, 0.5]).contains("at most 0.6 of length"));
    }
}
