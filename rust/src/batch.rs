//! Whole samples: shape, cameras, drawings, world grid and camera grids, as a function of (config, seed, index).

use crate::buffers::fill_frustum;
use crate::camera::{Camera, DISTANCE, FAR, FOV_DEGREES, IMAGE, NEAR, QUARTER_VIEWS, VIEWPOINTS};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::grammar::GrammarConfig;
use crate::lines::LineConfig;
use crate::pen::{PenConfig, redraw};
use crate::random::Random;
use crate::stroke;
use crate::style::StyleConfig;
use crate::subject::Subject;
use crate::voxel::{BitGrid, CELLS};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

/// Everything that a sample depends on beside seed and index.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct SampleConfig {
    pub grammar: GrammarConfig,
    /// Largest displacement of a camera along each of its axes, world units. The first is displaced parallel to
    /// the image only.
    pub displacement: f64,
    pub free: FreeConfig,
    pub lines: LineConfig,
    pub hand: HandConfig,
    pub styles: StyleConfig,
    /// Rays a side by which a camera-grid cell is measured; at most 4.
    pub frustum_rays: usize,
}

impl Default for SampleConfig {
    fn default() -> Self {
        Self {
            grammar: GrammarConfig::default(),
            displacement: 0.06,
            free: FreeConfig::default(),
            lines: LineConfig::default(),
            hand: HandConfig::default(),
            styles: StyleConfig::default(),
            frustum_rays: 2,
        }
    }
}

/// Cameras from anywhere around, for networks that are to take any calibrated drawing.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct FreeConfig {
    /// Share of the cameras that stand anywhere; the others stand at the viewpoints.
    pub share: f64,
    /// Degrees above the horizon, least and most.
    pub elevation: [f64; 2],
    /// Field of view in degrees, least and most; a ball around the world fills the image at any of them.
    pub fov: [f64; 2],
}

impl Default for FreeConfig {
    fn default() -> Self {
        Self { share: 0.0, elevation: [5.0, 60.0], fov: [25.0, 60.0] }
    }
}

/// Drawings as people make them: by a camera that is a little off the one that the truth is in, and by a pen.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct HandConfig {
    /// Share of the drawings that are made so; the others are exact.
    pub share: f64,
    /// Largest errors of the drawing camera, small ones being the more common: degrees, share of the field of view,
    /// and pixels by which the drawing is out of place.
    pub azimuth: f64,
    pub elevation: f64,
    pub roll: f64,
    pub fov: f64,
    pub shift: f64,
    pub pen: PenConfig,
}

impl Default for HandConfig {
    fn default() -> Self {
        let pen = PenConfig::default();
        Self { share: 0.0, azimuth: 10.0, elevation: 10.0, roll: 4.0, fov: 0.15, shift: 6.0, pen }
    }
}

impl SampleConfig {
    pub fn from_json(text: &str) -> Result<Self, CoreError> {
        let mut json = serde_json::Deserializer::from_str(text);
        let config: Self = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let path = error.path().to_string();
            let reason = error.into_inner();
            CoreError::Config(if path == "." { reason.to_string() } else { format!("{path}: {reason}") })
        })?;
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(message.into()));
        let hand = &self.hand;
        let pen = &hand.pen;
        let ranges = [
            pen.width,
            pen.bend,
            pen.wavelength,
            pen.gaps,
            pen.gap_length,
            pen.overshoots,
            pen.overshoot_length,
        ];
        self.grammar.check()?;
        self.lines.check()?;
        self.styles.check()?;
        if !(0.0..=1.0).contains(&self.displacement) {
            return bad("displacement must lie between 0 and 1");
        }
        let free = &self.free;
        let within = |[from, to]: [f64; 2], least: f64, most: f64| least <= from && from <= to && to <= most;
        if !((0.0..=1.0).contains(&free.share) && within(free.elevation, -85.0, 85.0)) {
            return bad("free: share must lie between 0 and 1, elevation [least, most] between -85 and 85");
        }
        if !within(free.fov, 10.0, 90.0) {
            return bad("free.fov must be [least, most] between 10 and 90");
        }
        if !(1..=4).contains(&self.frustum_rays) {
            return bad("frustum_rays must lie between 1 and 4");
        }
        if !(0.0..=1.0).contains(&hand.share) {
            return bad("hand.share must lie between 0 and 1");
        }
        let errors = [hand.azimuth, hand.elevation, hand.roll, hand.fov * 60.0];
        if !errors.iter().all(|e| (0.0..=45.0).contains(e)) {
            return bad("hand: angles must lie between 0 and 45 degrees, fov between 0 and 0.75");
        }
        if !(0.0..=256.0).contains(&hand.shift) {
            return bad("hand.shift must lie between 0 and 256 pixels");
        }
        if !ranges.iter().all(|[from, to]| 0.0 <= *from && from <= to && *to <= 256.0) {
            return bad("hand.pen: every entry is [least, most] in pixels, between 0 and 256");
        }
        Ok(())
    }
}

/// Where one sample's arrays go: `drawings` [views, 256, 256], `world` [64, 64, 64], `frusta` [views, 64, 64, 64].
pub struct Slot<'a> {
    pub drawings: &'a mut [u8],
    pub world: &'a mut [u8],
    pub frusta: &'a mut [u8],
}

/// Purposes of a sample's random streams; the pen of view v is `PEN + v`, its free camera `FREE + v`, its
/// style `STYLE + v`.
const SHAPE: u64 = 0;
const CAMERAS: u64 = 1;
const PEN: u64 = 2;
const FREE: u64 = 16;
const STYLE: u64 = 32;

/// Makes sample `index`, of as many views as `slot` has room for; of a shape of the grammar, or of the one that is given.
pub fn sample(
    config: &SampleConfig,
    seed: u64,
    index: u64,
    given: Option<&Shape>,
    slot: Slot,
) -> Result<(Shape, Vec<Camera>), CoreError> {
    let (shape, grid) = match given {
        Some(shape) => (shape.clone(), BitGrid::of_shape(shape)),
        None => config.grammar.draw(&mut Random::new(seed, index, SHAPE))?,
    };
    grid.write_bytes(slot.world);
    let cameras = draw_views(config, &shape, seed, index, slot.drawings)?;
    for (camera, frustum) in cameras.iter().zip(slot.frusta.chunks_exact_mut(CELLS)) {
        fill_frustum(&shape, camera, config.frustum_rays, frustum)?;
    }
    Ok((shape, cameras))
}

/// The drawings of sample `index`, as many as there is room for, of any subject; and the cameras that their truth is in.
pub fn draw_views(
    config: &SampleConfig,
    subject: &impl Subject,
    seed: u64,
    index: u64,
    drawings: &mut [u8],
) -> Result<Vec<Camera>, CoreError> {
    let views = drawings.len() / (IMAGE * IMAGE);
    let free = |v: usize| Random::new(seed, index, FREE + v as u64);
    let cameras = draw_cameras(config, subject, views, &mut Random::new(seed, index, CAMERAS), free);
    for (v, ((stand, camera), drawing)) in
        cameras.iter().zip(drawings.chunks_exact_mut(IMAGE * IMAGE)).enumerate()
    {
        let mut random = Random::new(seed, index, STYLE + v as u64);
        if random.chance(config.styles.share) {
            draw_in_style(config, subject, camera, &mut random, drawing)?;
            continue;
        }
        let mut random = Random::new(seed, index, PEN + v as u64);
        if random.chance(config.hand.share) {
            let hand = hand_camera(&config.hand, stand, camera, subject, &mut random);
            subject.draw(&hand, &config.lines, drawing)?;
            let ink = drawing.iter().map(|&ink| ink > 0).collect();
            drawing.copy_from_slice(&redraw(ink, &config.hand.pen, &mut random));
        } else {
            subject.draw(camera, &config.lines, drawing)?;
        }
    }
    Ok(cameras.into_iter().map(|(_, camera)| camera).collect())
}

/// Draws it in a style of its own, from about where the camera stands.
fn draw_in_style(
    config: &SampleConfig,
    subject: &impl Subject,
    camera: &Camera,
    random: &mut Random,
    drawing: &mut [u8],
) -> Result<(), CoreError> {
    let style = config.styles.draw(random);
    let turned = style.camera(camera, random);
    // A wide field of view brings it so near that it may stand within the shape.
    let camera = if subject.may_hold(turned.position) { camera } else { &turned };
    let mut lines = vec![0; IMAGE * IMAGE];
    subject.draw(camera, &config.lines, &mut lines)?;
    stroke::redraw(&lines, &style, random, drawing);
    Ok(())
}

/// How far a batch is, for those who wait for it, and their means to stop it.
#[derive(Default)]
pub struct Watch {
    finished: AtomicUsize,
    stopped: AtomicBool,
}

impl Watch {
    /// Samples finished so far.
    pub fn finished(&self) -> usize {
        self.finished.load(Relaxed)
    }

    /// Lets the samples that are being made be the last; the batch is [`CoreError::Stopped`].
    pub fn stop(&self) {
        self.stopped.store(true, Relaxed);
    }
}

/// Makes samples `first ..`, one a slot, on the threads of the current rayon pool; of shapes of the grammar, or of those
/// that are given, as many as there are slots.
pub fn batch(
    config: &SampleConfig,
    seed: u64,
    first: u64,
    given: Option<&[Shape]>,
    slots: Vec<Slot>,
    watch: &Watch,
) -> Result<Vec<(Shape, Vec<Camera>)>, CoreError> {
    // One at a time: nobody waits at the end for a thread that still has several to make.
    slots
        .into_par_iter()
        .with_max_len(1)
        .enumerate()
        .map(|(i, slot)| {
            if watch.stopped.load(Relaxed) {
                return Err(CoreError::Stopped);
            }
            let made = sample(config, seed, first.wrapping_add(i as u64), given.map(|g| &g[i]), slot)?;
            watch.finished.fetch_add(1, Relaxed);
            Ok(made)
        })
        .collect()
}

/// Where a camera stands before it is displaced, in degrees.
struct Stand {
    azimuth: f64,
    elevation: f64,
    fov: f64,
}

impl Stand {
    fn at_viewpoint(index: usize) -> Self {
        let (azimuth, elevation) = VIEWPOINTS[index];
        Self { azimuth, elevation, fov: FOV_DEGREES }
    }

    fn anywhere(config: &FreeConfig, random: &mut Random) -> Self {
        let azimuth = random.unit() * 360.0;
        Self { azimuth, elevation: random.between(config.elevation), fov: random.between(config.fov) }
    }

    /// How far from the origin: such that a ball around the world fills the image whatever the field of view.
    fn distance(&self) -> f64 {
        let sine = |fov: f64| (fov.to_radians() / 2.0).sin();
        DISTANCE * (sine(FOV_DEGREES) / sine(self.fov))
    }

    fn camera(&self, roll: f64) -> Camera {
        let distance = self.distance();
        let at = Camera::orbit(self.azimuth, self.elevation, roll, distance);
        let (near, far) = (distance + (NEAR - DISTANCE), distance + (FAR - DISTANCE));
        Camera::new(at.position, at.axes, self.fov, near, far).unwrap_or(at)
    }
}

/// Distinct viewpoints, the first one of the eight, some exchanged for free cameras, each displaced as far as the
/// shape stays in sight.
fn draw_cameras(
    config: &SampleConfig,
    subject: &impl Subject,
    views: usize,
    random: &mut Random,
    free: impl Fn(usize) -> Random,
) -> Vec<(Stand, Camera)> {
    let mut left: Vec<usize> = (0..VIEWPOINTS.len()).collect();
    let corners = corners(subject);
    (0..views)
        .map(|v| {
            let choices = if v == 0 { QUARTER_VIEWS } else { left.len() };
            let mut stand = Stand::at_viewpoint(left.remove(random.below(choices)));
            let mut free = free(v);
            if free.chance(config.free.share) {
                stand = Stand::anywhere(&config.free, &mut free);
            }
            let camera = stand.camera(0.0);
            let by = DVec3::from([(); 3].map(|()| random.around(config.displacement)));
            let by = if v == 0 { by.with_z(0.0) } else { by };
            let by = by * camera.room_for(by, &corners);
            (stand, camera.displaced(by))
        })
        .collect()
}

/// The camera that a person draws by: the given one, somewhat turned about the origin, at nearly the same displacement.
fn hand_camera(
    config: &HandConfig,
    stand: &Stand,
    camera: &Camera,
    subject: &impl Subject,
    random: &mut Random,
) -> Camera {
    // The product of two even numbers: mostly small, seldom near the largest.
    let mut error = |largest: f64| random.unit() * random.around(largest);
    let turned = Stand {
        azimuth: stand.azimuth + error(config.azimuth),
        elevation: stand.elevation + error(config.elevation),
        fov: stand.fov,
    };
    let turned = turned.camera(error(config.roll));
    let fov = camera.fov_degrees * (1.0 + error(config.fov));
    let pixel = 2.0 * camera.half_image * stand.distance() / IMAGE as f64;
    let shift = DVec3::new(error(config.shift), error(config.shift), 0.0) * pixel;
    let displacement = camera.to_camera(DVec3::ZERO) + shift;
    let by = DVec3::new(0.0, 0.0, stand.distance()) - displacement;
    let by = by * turned.room_for(by, &corners(subject));
    let turned = turned.displaced(by);
    Camera::new(turned.position, turned.axes, fov, camera.near, camera.far).unwrap_or(turned)
}

fn corners(subject: &impl Subject) -> Vec<DVec3> {
    let (lo, hi) = subject.bounds();
    (0..8)
        .map(|c| {
            let pick = |a: usize| if c >> a & 1 == 0 { lo[a] } else { hi[a] };
            DVec3::new(pick(0), pick(1), pick(2))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn make(config: &SampleConfig, index: u64, views: usize) -> (Vec<u8>, Vec<u8>, Vec<Camera>) {
        let mut drawings = vec![0; views * IMAGE * IMAGE];
        let (mut world, mut frusta) = (vec![0; CELLS], vec![0; views * CELLS]);
        let slot = Slot { drawings: &mut drawings, world: &mut world, frusta: &mut frusta };
        let (_, cameras) = sample(config, 3, index, None, slot).unwrap();
        (drawings, frusta, cameras)
    }

    #[test]
    fn fewer_views_are_the_first_of_more() {
        let mut config = SampleConfig::default();
        config.hand.share = 0.5;
        let (drawings, frusta, cameras) = make(&config, 11, 4);
        let (first, frustum, camera) = make(&config, 11, 1);
        assert!(drawings.starts_with(&first) && frusta.starts_with(&frustum));
        assert_eq!(cameras[0], camera[0]);
    }

    #[test]
    fn shapes_stay_in_sight() {
        let mut config = SampleConfig::default();
        for index in 0..40 {
            config.free.share = f64::from(index >= 20);
            let (drawings, frusta, cameras) = make(&config, index, 13);
            assert_eq!(cameras.len(), 13);
            for (drawing, frustum) in drawings.chunks(IMAGE * IMAGE).zip(frusta.chunks(CELLS)) {
                let border = (0..IMAGE).flat_map(|k| [k, (IMAGE - 1) * IMAGE + k, k * IMAGE]);
                assert!(border.clone().filter(|&i| drawing[i] > 0).count() < 8);
                assert!(frustum.contains(&255));
            }
        }
    }

    #[test]
    fn a_batch_says_how_far_it_is_and_can_be_stopped() {
        let mut arrays = vec![(vec![0; IMAGE * IMAGE], vec![0; CELLS], vec![0; CELLS]); 3];
        let mut run = |watch: &Watch| {
            let slots = arrays.iter_mut().map(|(drawings, world, frusta)| Slot { drawings, world, frusta });
            batch(&SampleConfig::default(), 3, 0, None, slots.collect(), watch)
        };
        let watch = Watch::default();
        assert_eq!(run(&watch).unwrap().len(), 3);
        assert_eq!(watch.finished(), 3);
        let watch = Watch::default();
        watch.stop();
        assert_eq!(run(&watch).unwrap_err(), CoreError::Stopped);
        assert_eq!(watch.finished(), 0);
    }

    #[test]
    fn configs_are_checked() {
        assert_eq!(SampleConfig::from_json("{}").unwrap(), SampleConfig::default());
        let refused = |text: &str| SampleConfig::from_json(text).unwrap_err().to_string();
        assert!(refused("{\"grammer\": 1}").contains("unknown field `grammer`"));
        assert!(refused("{\"free\": {\"share\": 2}}").contains("between 0 and 1"));
        assert!(refused("{\"free\": {\"elevation\": [60, 5]}}").contains("[least, most]"));
        assert!(refused("{\"free\": {\"fov\": [5, 50]}}").contains("between 10 and 90"));
        assert!(refused("{\"frustum_rays\": 9}").contains("between 1 and 4"));
        assert!(refused("{\"hand\": {\"pen\": {\"width\": [3, 1]}}}").contains("[least, most]"));
        assert!(refused("{").contains("EOF"));
    }
}
