//! How lines are put down: one meaning for the renderer, for training and for evaluation.
//!
//! A style says how far a drawing is from a renderer's: where it was really made from and lies on the paper, how its
//! strokes run (`stroke.rs`), and what the pen leaves (`brush.rs`). Lengths are pixels of the 256^2 image.

use crate::camera::Camera;
use crate::error::CoreError;
use crate::random::Random;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// One way of drawing. The default is the renderer's own, whose pixels stay as they are.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct LineStyle {
    /// Of the pen.
    pub width: f64,
    /// Whether pixels that a line covers in part get part of the ink; else all of it or none.
    pub antialias: bool,
    /// Largest share of the ink that the paper's grain and the hand's pressure leave out.
    pub noise: f64,
    /// Largest displacement of a stroke across itself, and about how long its waves are.
    pub wobble: f64,
    pub wavelength: f64,
    /// How far each stroke runs past both its ends, at most half its own length.
    pub overshoot: f64,
    /// Share of the length that is left out, in gaps of about 10 pixels.
    pub gaps: f64,
    /// Strokes for each line, and how far they lie apart.
    pub strokes: u32,
    pub apart: f64,
    /// Length at each end over which a stroke thins and fades.
    pub taper: f64,
    /// Degrees that the camera is turned about the origin, to a random side.
    pub viewpoint: f64,
    /// Share by which the field of view is larger or smaller, at the distance from which the object looks as large.
    pub field_of_view: f64,
    /// Factor of the drawing about its centre.
    pub scale: f64,
    /// How far the drawing is out of place, to a random side.
    pub shift: f64,
}

impl Default for LineStyle {
    fn default() -> Self {
        Self {
            width: 1.0,
            antialias: false,
            noise: 0.0,
            wobble: 0.0,
            wavelength: 40.0,
            overshoot: 0.0,
            gaps: 0.0,
            strokes: 1,
            apart: 0.0,
            taper: 0.0,
            viewpoint: 0.0,
            field_of_view: 0.0,
            scale: 1.0,
            shift: 0.0,
        }
    }
}

/// What a number of a style may be: its name, least and most.
type Limit = (&'static str, f64, f64);
const WIDTH: Limit = ("width", 0.25, 32.0);
const NOISE: Limit = ("noise", 0.0, 1.0);
const WOBBLE: Limit = ("wobble", 0.0, 64.0);
const WAVELENGTH: Limit = ("wavelength", 4.0, 1024.0);
const OVERSHOOT: Limit = ("overshoot", 0.0, 128.0);
const GAPS: Limit = ("gaps", 0.0, 0.9);
const STROKES: Limit = ("strokes", 1.0, 16.0);
const APART: Limit = ("apart", 0.0, 32.0);
const TAPER: Limit = ("taper", 0.0, 256.0);
const VIEWPOINT: Limit = ("viewpoint", 0.0, 90.0);
const FIELD_OF_VIEW: Limit = ("field_of_view", 0.0, 0.75);
const SCALE: Limit = ("scale", 0.1, 2.0);
const SHIFT: Limit = ("shift", 0.0, 256.0);

fn check((name, least, most): Limit, value: f64) -> Result<(), CoreError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(CoreError::Style(format!("{name} must lie between {least} and {most}, got {value}")))
}

impl LineStyle {
    pub fn from_json(text: &str) -> Result<Self, CoreError> {
        let style: Self = serde_json::from_str(text).map_err(|error| CoreError::Style(error.to_string()))?;
        style.check()?;
        Ok(style)
    }

    /// Says which number makes no sense.
    pub fn check(&self) -> Result<(), CoreError> {
        for (limit, value) in [
            (WIDTH, self.width),
            (NOISE, self.noise),
            (WOBBLE, self.wobble),
            (WAVELENGTH, self.wavelength),
            (OVERSHOOT, self.overshoot),
            (GAPS, self.gaps),
            (STROKES, f64::from(self.strokes)),
            (APART, self.apart),
            (TAPER, self.taper),
            (VIEWPOINT, self.viewpoint),
            (FIELD_OF_VIEW, self.field_of_view),
            (SCALE, self.scale),
            (SHIFT, self.shift),
        ] {
            check(limit, value)?;
        }
        Ok(())
    }

    /// Whether the lines stay the renderer's, whatever the camera does.
    pub fn leaves_lines(&self) -> bool {
        let Self { wavelength, viewpoint, field_of_view, .. } = *self;
        *self == Self { wavelength, viewpoint, field_of_view, ..Self::default() }
    }

    /// The camera that the drawing is really made from.
    pub fn camera(&self, camera: &Camera, random: &mut Random) -> Camera {
        let mut camera = *camera;
        if self.viewpoint > 0.0 {
            let (sin, cos) = (random.unit() * TAU).sin_cos();
            camera = camera.turned(self.viewpoint * cos, self.viewpoint * sin);
        }
        if self.field_of_view > 0.0 {
            let share = if random.chance(0.5) { self.field_of_view } else { -self.field_of_view };
            camera = camera.widened(share);
        }
        camera
    }
}

/// Styles to train with: each drawing gets one of its own. Pairs are ranges drawn from evenly, of the numbers of a
/// `LineStyle`; they reach halfway from the second to the third strength of the robustness table.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct StyleConfig {
    /// Share of the drawings that are traced and drawn again so.
    pub share: f64,
    /// How often each fault of the lines, and each of the camera and of the place, is there at all.
    pub faulty_lines: f64,
    pub faulty_camera: f64,
    pub width: [f64; 2],
    pub noise: [f64; 2],
    pub wobble: [f64; 2],
    pub wavelength: [f64; 2],
    pub overshoot: [f64; 2],
    pub gaps: [f64; 2],
    pub strokes: [u32; 2],
    pub apart: [f64; 2],
    pub taper: [f64; 2],
    pub viewpoint: [f64; 2],
    pub field_of_view: [f64; 2],
    pub scale: [f64; 2],
    pub shift: [f64; 2],
}

impl Default for StyleConfig {
    fn default() -> Self {
        Self {
            share: 0.0,
            faulty_lines: 0.5,
            faulty_camera: 0.3,
            width: [1.0, 3.5],
            noise: [0.0, 0.6],
            wobble: [0.0, 3.25],
            wavelength: [24.0, 80.0],
            overshoot: [0.0, 11.0],
            gaps: [0.0, 0.325],
            strokes: [2, 4],
            apart: [0.5, 2.5],
            taper: [0.0, 24.0],
            viewpoint: [0.0, 15.0],
            field_of_view: [0.0, 0.275],
            scale: [0.6, 1.0],
            shift: [0.0, 35.0],
        }
    }
}

impl StyleConfig {
    /// Says which range makes no sense.
    pub fn check(&self) -> Result<(), CoreError> {
        for (name, share) in [
            ("share", self.share),
            ("faulty_lines", self.faulty_lines),
            ("faulty_camera", self.faulty_camera),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(CoreError::Config(format!(
                    "styles.{name} must lie between 0 and 1, got {share}"
                )));
            }
        }
        for ((name, least, most), [from, to]) in [
            (WIDTH, self.width),
            (NOISE, self.noise),
            (WOBBLE, self.wobble),
            (WAVELENGTH, self.wavelength),
            (OVERSHOOT, self.overshoot),
            (GAPS, self.gaps),
            (STROKES, self.strokes.map(f64::from)),
            (APART, self.apart),
            (TAPER, self.taper),
            (VIEWPOINT, self.viewpoint),
            (FIELD_OF_VIEW, self.field_of_view),
            (SCALE, self.scale),
            (SHIFT, self.shift),
        ] {
            if !(least <= from && from <= to && to <= most) {
                return Err(CoreError::Config(format!(
                    "styles.{name} must be [least, most] between {least} and {most}, got [{from}, {to}]"
                )));
            }
        }
        Ok(())
    }

    /// A style drawn from these ranges.
    pub fn draw(&self, random: &mut Random) -> LineStyle {
        let clean = LineStyle::default();
        // As many numbers for a fault that is absent: the others do not depend on it.
        let mut fault = |often: f64, range: [f64; 2], absent: f64| {
            let (there, amount) = (random.chance(often), random.between(range));
            if there { amount } else { absent }
        };
        let (lines, camera) = (self.faulty_lines, self.faulty_camera);
        let [few, many] = self.strokes.map(f64::from);
        LineStyle {
            antialias: true,
            width: fault(lines, self.width, clean.width),
            noise: fault(lines, self.noise, 0.0),
            wobble: fault(lines, self.wobble, 0.0),
            wavelength: fault(1.0, self.wavelength, clean.wavelength),
            overshoot: fault(lines, self.overshoot, 0.0),
            gaps: fault(lines, self.gaps, 0.0),
            strokes: fault(lines, [few, many + 1.0], 1.0) as u32,
            apart: fault(1.0, self.apart, 0.0),
            taper: fault(lines, self.taper, 0.0),
            viewpoint: fault(camera, self.viewpoint, 0.0),
            field_of_view: fault(camera, self.field_of_view, 0.0),
            scale: fault(camera, self.scale, 1.0),
            shift: fault(camera, self.shift, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn styles_are_checked() {
        assert_eq!(LineStyle::from_json("{}").unwrap(), LineStyle::default());
        let refused = |text: &str| LineStyle::from_json(text).unwrap_err().to_string();
        assert!(refused("{\"wobble\": -1}").contains("wobble must lie between 0 and 64, got -1"));
        assert!(refused("{\"wiggle\": 1}").contains("unknown field `wiggle`"));
        let nan = LineStyle { taper: f64::NAN, ..LineStyle::default() };
        assert!(nan.check().unwrap_err().to_string().contains("taper"));
        let ranges = StyleConfig { gaps: [0.3, 0.1], ..StyleConfig::default() };
        assert!(ranges.check().unwrap_err().to_string().contains("styles.gaps must be [least, most]"));
    }

    #[test]
    fn drawn_styles_stay_in_their_ranges_and_some_lack_each_fault() {
        let config = StyleConfig::default();
        config.check().unwrap();
        let drawn: Vec<_> = (0..400).map(|i| config.draw(&mut Random::new(1, i, 0))).collect();
        assert!(drawn.iter().all(|s| s.check().is_ok() && (1..=4).contains(&s.strokes)));
        let share = |has: fn(&LineStyle) -> bool| drawn.iter().filter(|s| has(s)).count() as f64 / 400.0;
        assert!((share(|s| s.wobble > 0.0) - 0.5).abs() < 0.1);
        assert!((share(|s| s.shift > 0.0) - 0.3).abs() < 0.1);
        assert!((share(|s| s.strokes > 1) - 0.5).abs() < 0.1 && share(|s| s.strokes == 4) > 0.1);
    }

    #[test]
    fn a_style_of_the_camera_alone_leaves_the_lines() {
        let turned = LineStyle { viewpoint: 10.0, field_of_view: 0.2, ..LineStyle::default() };
        assert!(turned.leaves_lines());
        assert!(!LineStyle { width: 2.0, ..LineStyle::default() }.leaves_lines());
        let camera = Camera::orbit(30.0, 20.0, 0.0, 2.0);
        for seed in 0..8 {
            let other = turned.camera(&camera, &mut Random::new(seed, 0, 0));
            let angle = camera.axes[2].dot(other.axes[2]).acos().to_degrees();
            assert!((angle - 10.0).abs() < 1e-9, "{angle}");
            assert!(((other.fov_degrees / camera.fov_degrees - 1.0).abs() - 0.2).abs() < 1e-12);
            let size = |c: &Camera| c.to_camera(glam::DVec3::ZERO).z * c.half_image;
            assert!((size(&camera) - size(&other)).abs() < 1e-12);
        }
    }
}
