//! Kinds of lines, each alone or together: where surfaces end, fold, bend most or are shaded, seen or hidden.
//!
//! All but the hidden ones are found in depth and normal buffers, of whatever they are.

use crate::buffers::{Buffers, Pixels, image_points};
use crate::camera::{Camera, IMAGE};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::hatching::hatch;
use crate::lines::{LineConfig, detect};
use crate::random::Random;
use crate::raycast::{RAYS, RayCaster, TILE, Tile};
use crate::stroke::{self, LEAST_INK, STEP};
use crate::style::LineStyle;
use crate::trace::{Stroke, TraceConfig, thin, trace};
use glam::{DVec3, Vec3};

/// Which lines to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Kinds {
    /// Where a surface ends before another one or before nothing.
    pub contours: bool,
    /// Where normals jump.
    pub creases: bool,
    /// Where a surface bends most, outwards or inwards; sharp edges among them.
    pub ridges: bool,
    pub valleys: bool,
    /// Valleys of brightness under a light at the eye (DeCarlo et al., 2003): contours of views nearby.
    pub suggestive: bool,
    /// Dashed: contours and creases behind the first surface.
    pub hidden: bool,
    /// Strokes in the shade.
    pub hatching: bool,
}

impl Kinds {
    pub const NAMES: [&str; 7] =
        ["contours", "creases", "ridges", "valleys", "suggestive", "hidden", "hatching"];

    /// The kinds of these names.
    pub fn of<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, CoreError> {
        let mut kinds = Self::default();
        for name in names {
            let flag = match name {
                "contours" => &mut kinds.contours,
                "creases" => &mut kinds.creases,
                "ridges" => &mut kinds.ridges,
                "valleys" => &mut kinds.valleys,
                "suggestive" => &mut kinds.suggestive,
                "hidden" => &mut kinds.hidden,
                "hatching" => &mut kinds.hatching,
                _ => {
                    let message = format!("unknown kind {name:?}; the kinds are {}", Self::NAMES.join(", "));
                    return Err(CoreError::Style(message));
                }
            };
            *flag = true;
        }
        Ok(kinds)
    }
}

/// Dashes, and what lies between them, pixels.
const DASH: usize = 6;
const BETWEEN: usize = 4;
/// Hidden lines and hatching are thinner than others.
const LIGHTER: f64 = 0.75;

/// Draws lines of some kinds, 256 x 256. `hidden` has the pixels of hidden lines, see [`hidden_lines`].
pub fn draw(
    buffers: &Buffers,
    camera: &Camera,
    hidden: Option<&[u8]>,
    kinds: Kinds,
    style: &LineStyle,
    random: &mut Random,
    out: &mut [u8],
) {
    assert_eq!((buffers.size, out.len()), (IMAGE, IMAGE * IMAGE));
    let mut ink = vec![0; IMAGE * IMAGE];
    seen(buffers, camera, kinds, &mut ink);
    let plain = style.leaves_lines();
    let mut groups = Vec::new();
    if plain {
        out.copy_from_slice(&ink);
    } else {
        out.fill(0);
        let through = TraceConfig { step: STEP, through: true };
        groups.push((trace(&ink, LEAST_INK, through), style.clone()));
    }
    let quiet =
        LineStyle { overshoot: 0.0, gaps: 0.0, strokes: 1, width: style.width * LIGHTER, ..style.clone() };
    let quiet = if plain { style.clone() } else { quiet };
    if let Some(hidden) = hidden.filter(|_| kinds.hidden) {
        let strokes = trace(hidden, LEAST_INK, TraceConfig { step: STEP, through: true });
        let strokes = strokes.iter().filter(|s| s.points.len() > DASH / STEP);
        groups.push((strokes.flat_map(dashes).collect(), LineStyle { taper: 0.0, ..quiet.clone() }));
    }
    if kinds.hatching {
        groups.push((hatch(buffers, camera), quiet));
    }
    stroke::put_down(groups, style, random, out);
    stroke::finish(style, random, out);
}

/// The pixels of all lines that are seen, added to `ink`.
fn seen(buffers: &Buffers, camera: &Camera, kinds: Kinds, ink: &mut [u8]) {
    let config = LineConfig::default();
    let mut contours = vec![0; IMAGE * IMAGE];
    detect(buffers, &LineConfig { crease_degrees: 180.0, ..config.clone() }, &mut contours);
    if kinds.contours {
        ink.copy_from_slice(&contours);
    }
    if kinds.creases {
        let mut all = vec![0; IMAGE * IMAGE];
        detect(buffers, &config, &mut all);
        for i in 0..all.len() {
            ink[i] |= all[i] & !contours[i];
        }
    }
    if kinds.ridges || kinds.valleys || kinds.suggestive {
        let mut bends = vec![0; IMAGE * IMAGE];
        Bends::new(buffers, camera, config).mark(kinds, &mut bends);
        thin(&mut bends, SPECK);
        ink.iter_mut().zip(&bends).for_each(|(i, b)| *i |= b);
    }
}

/// How surfaces bend from pixel to pixel.
struct Bends<'a> {
    buffers: &'a Buffers,
    camera: &'a Camera,
    config: LineConfig,
    /// The cosine between normal and view.
    light: Vec<f32>,
}

/// Surfaces bend at ridges and valleys by at least this, 1 / world units: about a radius of 5 voxels.
const CURVATURE: f64 = 12.0;
/// And by so much more than a few pixels beside.
const PROMINENCE: f64 = 1.25;
const BESIDE: i64 = 4;
/// How much darker than both sides a valley of brightness is, so many pixels away.
const DARKER: f32 = 0.02;
const ACROSS: i64 = 6;
/// Ridges, valleys and suggestive contours of fewer pixels are left out.
const SPECK: usize = 5;
/// Half of the directions in the image.
const WAYS: [[i64; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

impl<'a> Bends<'a> {
    fn new(buffers: &'a Buffers, camera: &'a Camera, config: LineConfig) -> Self {
        let light = (0..IMAGE * IMAGE)
            .map(|i| {
                let view = view(camera, i);
                -Vec3::from(buffers.normal[i]).dot(view.normalize().as_vec3())
            })
            .collect();
        Self { buffers, camera, config, light }
    }

    fn mark(&self, kinds: Kinds, ink: &mut [u8]) {
        let folds = kinds.ridges || kinds.valleys;
        let bends = if folds { self.greatest() } else { Vec::new() };
        for (i, ink) in ink.iter_mut().enumerate().filter(|&(i, _)| self.buffers.depth[i].is_finite()) {
            let (x, y) = ((i % IMAGE) as i64, (i / IMAGE) as i64);
            let folds = folds && WAYS.iter().any(|&way| self.folds(&bends, x, y, way, kinds));
            let marked = folds || (kinds.suggestive && self.darkens(x, y, self.across(x, y)));
            if marked {
                *ink = 255;
            }
        }
    }

    /// The greatest normal curvature of any way at each pixel, with its sign; no number where there is none.
    fn greatest(&self) -> Vec<f64> {
        let at = |i: usize| {
            let (x, y) = ((i % IMAGE) as i64, (i / IMAGE) as i64);
            let all = WAYS.iter().filter_map(|&way| self.curvature(x, y, way));
            all.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::NAN)
        };
        (0..IMAGE * IMAGE).map(at).collect()
    }

    /// Whether a surface bends most here of what lies along a way, outwards or inwards as asked.
    fn folds(&self, bends: &[f64], x: i64, y: i64, way: [i64; 2], kinds: Kinds) -> bool {
        let here = bends[(y * IMAGE as i64 + x) as usize];
        let asked = if here > 0.0 { kinds.ridges } else { kinds.valleys };
        let least = here.abs();
        if !asked || least.is_nan() || least < CURVATURE {
            return false;
        }
        // A neighbour that has no curvature says nothing; a surface that ends on all sides has no ridge.
        let at = |k: i64| {
            let there = self.place(x + k * way[0], y + k * way[1]).map_or(f64::NAN, |i| bends[i]);
            there * here.signum()
        };
        let sides = [at(-BESIDE), at(BESIDE)];
        let less = |a: f64, b: f64| a.is_nan() || a < b;
        (less(at(1), least) || at(1) == least)
            && less(at(-1), least)
            && !sides.iter().all(|c| c.is_nan())
            && sides.iter().all(|&c| less(PROMINENCE * c, least))
    }

    /// The normal curvature along a way, 1 / world units, more than 0 outwards; `None` across a step of depth.
    fn curvature(&self, x: i64, y: i64, [dx, dy]: [i64; 2]) -> Option<f64> {
        let (a, b, c) = (self.place(x - dx, y - dy)?, self.place(x, y)?, self.place(x + dx, y + dy)?);
        let near = |i: usize| 1.0 / self.buffers.depth[i];
        let bend = 2.0 * near(b) - near(a) - near(c);
        if bend.abs() > self.config.depth_step || (near(a) - near(c)).abs() > 4.0 * self.config.depth_step {
            return None;
        }
        let point = |i: usize| view(self.camera, i) * f64::from(self.buffers.depth[i]);
        let normal = |i: usize| Vec3::from(self.buffers.normal[i]).as_dvec3();
        let along = point(c) - point(a);
        Some((normal(c) - normal(a)).dot(along) / along.length_squared())
    }

    /// The way along which brightness bends upwards most.
    fn across(&self, x: i64, y: i64) -> [i64; 2] {
        let bend = |[dx, dy]: &[i64; 2]| {
            let at = |k: i64| self.place(x + k * dx, y + k * dy).map(|i| self.light[i]);
            // Diagonal neighbours are farther away.
            let long = if dx * dy == 0 { 1.0 } else { 2.0 };
            let bends = at(ACROSS).zip(at(-ACROSS)).zip(at(0)).map(|((a, b), c)| (a + b - 2.0 * c) / long);
            bends.unwrap_or(f32::NEG_INFINITY)
        };
        WAYS.into_iter().max_by(|a, b| bend(a).total_cmp(&bend(b))).expect("there are four ways")
    }

    /// Whether it is darker here than on both sides, on one smooth surface.
    fn darkens(&self, x: i64, y: i64, [dx, dy]: [i64; 2]) -> bool {
        let Some(here) = self.place(x, y) else { return false };
        [-1, 1].into_iter().all(|side| {
            let mut before = here;
            for k in 1..=ACROSS {
                let Some(next) = self.place(x + side * k * dx, y + side * k * dy) else { return false };
                let smooth =
                    Vec3::from(self.buffers.normal[before]).dot(Vec3::from(self.buffers.normal[next]));
                let step = 1.0 / self.buffers.depth[before] - 1.0 / self.buffers.depth[next];
                let darker =
                    self.light[next] < self.light[here] || (side < 0 && self.light[next] == self.light[here]);
                if smooth < 0.9 || step.abs() > 2.0 * self.config.depth_step || (k < 4 && darker) {
                    return false;
                }
                before = next;
            }
            self.light[before] - self.light[here] > DARKER
        })
    }

    /// A pixel's place, if something is seen there.
    fn place(&self, x: i64, y: i64) -> Option<usize> {
        let side = 0..IMAGE as i64;
        let i = (side.contains(&x) && side.contains(&y)).then(|| (y * IMAGE as i64 + x) as usize)?;
        self.buffers.depth[i].is_finite().then_some(i)
    }
}

/// The way through a pixel in the world, as long as one unit of depth.
pub fn view(camera: &Camera, pixel: usize) -> DVec3 {
    let at = |k: usize| (2 * k + 1) as f64 / IMAGE as f64 - 1.0;
    camera.ray(at(pixel % IMAGE), at(pixel / IMAGE))
}

/// A stroke in pieces.
fn dashes(stroke: &Stroke) -> Vec<Stroke> {
    let (on, period) = (DASH / STEP, (DASH + BETWEEN) / STEP);
    let piece = |from: usize| {
        let to = (from + on).min(stroke.points.len() - 1);
        (to > from).then(|| Stroke { points: stroke.points[from..=to].to_vec(), closed: false })
    };
    (0..stroke.points.len()).step_by(period).filter_map(piece).collect()
}

/// More surfaces one behind the other are not looked at.
const LAYERS: usize = 24;

/// The pixels, 256 x 256, of contours and creases behind the first surface, but beside lines that are seen.
///
/// All surfaces along the rays, peeled off one by one: where one begins or ends is a contour in every layer behind.
pub fn hidden_lines(shape: &Shape, camera: &Camera) -> Result<Vec<u8>, CoreError> {
    let layers = layers(shape, camera)?;
    let config = LineConfig::default();
    let mut ink = vec![0; IMAGE * IMAGE];
    let mut seen = vec![0; IMAGE * IMAGE];
    for (number, layer) in layers.iter().enumerate() {
        let mut lines = vec![0; IMAGE * IMAGE];
        detect(layer, &config, &mut lines);
        if number == 0 {
            seen = lines;
        } else {
            ink.iter_mut().zip(&lines).for_each(|(i, l)| *i |= l);
        }
    }
    for i in (0..seen.len()).filter(|&i| seen[i] > 0) {
        let (x, y) = (i % IMAGE, i / IMAGE);
        for row in y.saturating_sub(2)..(y + 3).min(IMAGE) {
            ink[row * IMAGE + x.saturating_sub(2)..row * IMAGE + (x + 3).min(IMAGE)].fill(0);
        }
    }
    Ok(ink)
}

/// Every surface that rays go through, in order: into the shape, out of it, into it again.
fn layers(shape: &Shape, camera: &Camera) -> Result<Vec<Buffers>, CoreError> {
    let caster = RayCaster::new(shape, camera)?;
    let mut layers: Vec<Buffers> = Vec::new();
    let mut tile = Tile::new(&caster);
    for top in (0..IMAGE).step_by(TILE) {
        tile.choose(&caster, &image_points(top, IMAGE));
        for left in (0..IMAGE).step_by(TILE) {
            if !tile.cast(&caster, &image_points(left, IMAGE)) {
                continue;
            }
            let mut hits = tile.entries(None);
            for number in 0..LAYERS {
                if layers.len() == number {
                    let (depth, normal) = (vec![f32::INFINITY; IMAGE * IMAGE], vec![[0.0; 3]; IMAGE * IMAGE]);
                    layers.push(Buffers { depth, normal, size: IMAGE });
                }
                let pixels = Pixels::of(&caster, &tile, &hits);
                for lane in 0..RAYS {
                    let i = (top + lane / TILE) * IMAGE + left + lane % TILE;
                    layers[number].depth[i] = pixels.depth[lane];
                    layers[number].normal[i] = [0, 1, 2].map(|axis| pixels.normal[axis][lane]);
                }
                hits = if number % 2 == 0 {
                    tile.exits(&hits.nearness)
                } else if tile.goes_on(&hits.nearness) {
                    tile.entries(Some(&hits.nearness))
                } else {
                    break;
                };
            }
        }
    }
    Ok(layers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::{Kind, Primitive};

    fn cube() -> (Shape, Camera) {
        let half = DVec3::splat(0.3);
        let primitive = Primitive { kind: Kind::Cuboid, additive: true, center: DVec3::ZERO, half };
        (Shape::new(vec![primitive]).unwrap(), Camera::orbit(37.5, 38.0, 0.0, 2.0))
    }

    fn drawn(kinds: &[&str]) -> Vec<u8> {
        let (shape, camera) = cube();
        let buffers = Buffers::of_shape(&shape, &camera, IMAGE).unwrap();
        let hidden = hidden_lines(&shape, &camera).unwrap();
        let mut out = vec![0; IMAGE * IMAGE];
        let kinds = Kinds::of(kinds.iter().copied()).unwrap();
        draw(
            &buffers,
            &camera,
            Some(&hidden),
            kinds,
            &LineStyle::default(),
            &mut Random::new(1, 0, 0),
            &mut out,
        );
        out
    }

    #[test]
    fn contours_and_creases_are_all_lines() {
        let (shape, camera) = cube();
        let mut all = vec![0; IMAGE * IMAGE];
        crate::lines::draw(&shape, &camera, &LineConfig::default(), &mut all).unwrap();
        assert!(drawn(&["contours", "creases"]) == all);
        let (contours, creases) = (drawn(&["contours"]), drawn(&["creases"]));
        assert!(contours.iter().zip(&creases).all(|(a, b)| a & b == 0));
        assert!(creases.contains(&255) && contours.contains(&255));
    }

    #[test]
    fn a_box_has_three_hidden_edges_that_meet() {
        // Not quite a cube: the nearest and the farthest corner are apart.
        let (_, camera) = cube();
        let half = DVec3::new(0.3, 0.15, 0.3);
        let primitive = Primitive { kind: Kind::Cuboid, additive: true, center: DVec3::ZERO, half };
        let shape = Shape::new(vec![primitive]).unwrap();
        let strokes =
            trace(&hidden_lines(&shape, &camera).unwrap(), 64, TraceConfig { step: 2, through: true });
        // The corner that is farthest from the eye.
        let far = camera.to_camera(DVec3::new(-0.3, -0.15, -0.3));
        let pixel = |v: f64| ((v / (far.z * camera.half_image) + 1.0) * 128.0 - 0.5) as f32;
        let (x, y) = (pixel(far.x), pixel(far.y));
        let near = |p: &[f32; 2]| (p[0] - x).hypot(p[1] - y) < 3.0;
        let meeting = |s: &&Stroke| s.points.first().is_some_and(near) || s.points.last().is_some_and(near);
        assert_eq!(strokes.iter().filter(meeting).filter(|s| s.points.len() > 10).count(), 3);
    }

    #[test]
    fn hidden_lines_are_dashed() {
        let (shape, camera) = cube();
        let line = hidden_lines(&shape, &camera).unwrap().iter().filter(|&&v| v > 0).count();
        let dashed = drawn(&["hidden"]).iter().filter(|&&v| v > 0).count();
        let share = dashed as f64 / line as f64;
        assert!((0.55..0.85).contains(&share), "{share}");
    }

    #[test]
    fn a_cube_has_ridges_and_no_valleys() {
        let creases = drawn(&["creases"]);
        let ridges = drawn(&["ridges"]);
        let near = |i: usize| (0..9).any(|k| ridges[i + k / 3 * IMAGE + k % 3 - IMAGE - 1] > 0);
        let found = (0..creases.len()).filter(|&i| creases[i] > 0 && near(i)).count();
        assert!(found as f64 > 0.95 * creases.iter().filter(|&&v| v > 0).count() as f64);
        assert!(drawn(&["valleys", "suggestive"]).iter().all(|&v| v == 0));
    }

    #[test]
    fn a_wave_is_darkest_where_it_is_steepest() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        // A gentle wave across the image: slopes vary, creases and contours there are none.
        let (mut depth, mut normal) = (vec![0.0; IMAGE * IMAGE], vec![[0.0; 3]; IMAGE * IMAGE]);
        let period = 64.0;
        for i in 0..IMAGE * IMAGE {
            let phase = (i % IMAGE) as f64 / period * std::f64::consts::TAU;
            depth[i] = (2.0 - 0.02 * phase.sin()) as f32;
            let n = camera.axes[0] * (-0.6 * phase.cos()) - camera.axes[2];
            normal[i] = n.normalize().as_vec3().to_array();
        }
        let buffers = Buffers { depth, normal, size: IMAGE };
        let kinds = Kinds { suggestive: true, ..Kinds::default() };
        let mut ink = vec![0; IMAGE * IMAGE];
        seen(&buffers, &camera, kinds, &mut ink);
        // Steepest at every half period, but for the tilt of the view.
        let columns: Vec<usize> = (8..248).filter(|&x| ink[128 * IMAGE + x] > 0).collect();
        assert!((5..=8).contains(&columns.len()), "{columns:?}");
        assert!(columns.iter().all(|&x| (x + 4) % 32 <= 8), "{columns:?}");
    }

    #[test]
    fn unknown_kinds_are_refused() {
        assert!(Kinds::of(["edges"]).unwrap_err().to_string().contains("the kinds are contours, creases"));
    }
}
