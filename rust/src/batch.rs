//! Whole samples: shape, cameras, drawings, world grid and camera grids, as a function of (config, seed, index).

use crate::buffers::fill_frustum;
use crate::camera::{Camera, DISTANCE, IMAGE, QUARTER_VIEWS, VIEWPOINTS};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::grammar::GrammarConfig;
use crate::lines::{LineConfig, draw};
use crate::pen::{PenConfig, redraw};
use crate::random::Random;
use crate::voxel::CELLS;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Everything that a sample depends on beside seed and index.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct SampleConfig {
    pub grammar: GrammarConfig,
    /// Largest displacement of a camera along each of its axes, world units. The first is displaced parallel to
    /// the image only.
    pub displacement: f64,
    pub lines: LineConfig,
    pub hand: HandConfig,
    /// Rays a side by which a camera-grid cell is measured; at most 4.
    pub frustum_rays: usize,
}

impl Default for SampleConfig {
    fn default() -> Self {
        Self {
            grammar: GrammarConfig::default(),
            displacement: 0.06,
            lines: LineConfig::default(),
            hand: HandConfig::default(),
            frustum_rays: 2,
        }
    }
}

/// Drawings as people make them: by a camera that is a little off the one that the truth is in, and by a pen.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct HandConfig {
    /// Share of the drawings that are made so; the others are exact.
    pub share: f64,
    /// Largest errors of the drawing camera: degrees, and share of the field of view.
    pub azimuth: f64,
    pub elevation: f64,
    pub roll: f64,
    pub fov: f64,
    pub pen: PenConfig,
}

impl Default for HandConfig {
    fn default() -> Self {
        Self { share: 0.0, azimuth: 4.0, elevation: 4.0, roll: 2.0, fov: 0.08, pen: PenConfig::default() }
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
        if !(0.0..=1.0).contains(&self.displacement) {
            return bad("displacement must lie between 0 and 1");
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

/// Purposes of a sample's random streams; the pen of view v is `PEN + v`.
const SHAPE: u64 = 0;
const CAMERAS: u64 = 1;
const PEN: u64 = 2;

/// Makes sample `index`, of as many views as `slot` has room for.
pub fn sample(
    config: &SampleConfig,
    seed: u64,
    index: u64,
    slot: Slot,
) -> Result<(Shape, Vec<Camera>), CoreError> {
    let views = slot.drawings.len() / (IMAGE * IMAGE);
    let (shape, grid) = config.grammar.draw(&mut Random::new(seed, index, SHAPE))?;
    grid.write_bytes(slot.world);
    let cameras = draw_cameras(config, &shape, views, &mut Random::new(seed, index, CAMERAS));
    let arrays = slot.drawings.chunks_exact_mut(IMAGE * IMAGE).zip(slot.frusta.chunks_exact_mut(CELLS));
    for (v, ((viewpoint, camera), (drawing, frustum))) in cameras.iter().zip(arrays).enumerate() {
        let mut random = Random::new(seed, index, PEN + v as u64);
        if random.chance(config.hand.share) {
            let hand = hand_camera(&config.hand, *viewpoint, camera, &shape, &mut random);
            draw(&shape, &hand, &config.lines, drawing)?;
            let ink = drawing.iter().map(|&ink| ink > 0).collect();
            drawing.copy_from_slice(&redraw(ink, &config.hand.pen, &mut random));
        } else {
            draw(&shape, camera, &config.lines, drawing)?;
        }
        fill_frustum(&shape, camera, config.frustum_rays, frustum)?;
    }
    Ok((shape, cameras.into_iter().map(|(_, camera)| camera).collect()))
}

/// Makes samples `first ..`, one a slot, on the threads of the current rayon pool.
pub fn batch(
    config: &SampleConfig,
    seed: u64,
    first: u64,
    slots: Vec<Slot>,
) -> Result<Vec<(Shape, Vec<Camera>)>, CoreError> {
    slots
        .into_par_iter()
        .enumerate()
        .map(|(i, slot)| sample(config, seed, first.wrapping_add(i as u64), slot))
        .collect()
}

/// Distinct viewpoints, the first one of the eight, each displaced as far as the shape stays in sight.
fn draw_cameras(
    config: &SampleConfig,
    shape: &Shape,
    views: usize,
    random: &mut Random,
) -> Vec<(usize, Camera)> {
    let mut free: Vec<usize> = (0..VIEWPOINTS.len()).collect();
    let corners = corners(shape);
    (0..views)
        .map(|v| {
            let choices = if v == 0 { QUARTER_VIEWS } else { free.len() };
            let viewpoint = free.remove(random.below(choices));
            let (azimuth, elevation) = VIEWPOINTS[viewpoint];
            let camera = Camera::orbit(azimuth, elevation, 0.0, DISTANCE);
            let by = DVec3::from([(); 3].map(|()| random.around(config.displacement)));
            let by = if v == 0 { by.with_z(0.0) } else { by };
            (viewpoint, camera.displaced(by * camera.room_for(by, &corners)))
        })
        .collect()
}

/// The camera that a person draws by: the given one, somewhat turned about the origin, at the same displacement.
fn hand_camera(
    config: &HandConfig,
    viewpoint: usize,
    camera: &Camera,
    shape: &Shape,
    random: &mut Random,
) -> Camera {
    let (azimuth, elevation) = VIEWPOINTS[viewpoint];
    let displacement = camera.to_camera(DVec3::ZERO);
    let turned = Camera::orbit(
        azimuth + random.around(config.azimuth),
        elevation + random.around(config.elevation),
        random.around(config.roll),
        DISTANCE,
    );
    let by = DVec3::new(0.0, 0.0, DISTANCE) - displacement;
    let fov = camera.fov_degrees * (1.0 + random.around(config.fov));
    let by = by * turned.room_for(by, &corners(shape));
    let turned = turned.displaced(by);
    Camera::new(turned.position, turned.axes, fov, camera.near, camera.far).unwrap_or(turned)
}

fn corners(shape: &Shape) -> Vec<DVec3> {
    let (lo, hi) = shape.bounds();
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
        let (_, cameras) = sample(config, 3, index, slot).unwrap();
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
        let config = SampleConfig::default();
        for index in 0..40 {
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
    fn configs_are_checked() {
        assert_eq!(SampleConfig::from_json("{}").unwrap(), SampleConfig::default());
        let refused = |text: &str| SampleConfig::from_json(text).unwrap_err().to_string();
        assert!(refused("{\"grammer\": 1}").contains("unknown field `grammer`"));
        assert!(refused("{\"frustum_rays\": 9}").contains("between 1 and 4"));
        assert!(refused("{\"hand\": {\"pen\": {\"width\": [3, 1]}}}").contains("[least, most]"));
        assert!(refused("{").contains("EOF"));
    }
}
