//! Saito-Takahashi lines: an edge detector over depth and normal buffers (paper, section 4.2).
//!
//! Profile edges come from the second difference of *inverse* depth, which is zero on every plane at every
//! slant; creases from the angle between normals. Every line pixel lies on the object, and every object pixel
//! beside the background is a line: so outlines are closed, and the background, flooded over its four-connected
//! neighbours from the border, never gets in.

use crate::buffers::{Buffers, cast_row};
use crate::camera::{Camera, IMAGE};
use crate::csg::Shape;
use crate::dispatch::dispatched;
use crate::error::CoreError;
use crate::raycast::{RayCaster, TILE, Tile};
use serde::{Deserialize, Serialize};

/// When a change of depth or normal is a line.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct LineConfig {
    /// Second difference of inverse depth, 1 / world units. A step of one voxel at depth 2 leaves 0.004.
    pub depth_step: f32,
    /// Least angle between the normals of neighbours, degrees.
    pub crease_degrees: f32,
}

impl Default for LineConfig {
    fn default() -> Self {
        Self { depth_step: 0.006, crease_degrees: 30.0 }
    }
}

impl LineConfig {
    /// Says which threshold makes no sense.
    pub fn check(&self) -> Result<(), CoreError> {
        if !(self.depth_step > 0.0 && self.depth_step.is_finite()) {
            return Err(CoreError::Config("lines.depth_step must be more than 0 and finite".into()));
        }
        if !(0.0..=180.0).contains(&self.crease_degrees) {
            return Err(CoreError::Config("lines.crease_degrees must lie between 0 and 180".into()));
        }
        Ok(())
    }
}

/// Draws a shape: 255 where there is ink, 0 elsewhere, row by row.
pub fn draw(shape: &Shape, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError> {
    assert_eq!(ink.len(), IMAGE * IMAGE);
    draw_seen(&RayCaster::new(shape, camera)?, config, ink);
    Ok(())
}

/// Draws an image that has been cast already.
pub fn detect(buffers: &Buffers, config: &LineConfig, ink: &mut [u8]) {
    assert_eq!(ink.len(), buffers.size * buffers.size);
    draw_buffers(buffers, config, ink);
}

dispatched! {
    fn draw_seen(caster: &RayCaster, config: &LineConfig, ink: &mut [u8]) {
        let mut tile = Tile::new(caster);
        draw_strips(IMAGE, config, ink, |top, strip| {
            cast_row(caster, &mut tile, IMAGE, top, |left, depth, normal| {
                let [x, y, z] = normal;
                for row in 0..TILE {
                    let at = row * TILE..(row + 1) * TILE;
                    let normal = [&x[at.clone()], &y[at.clone()], &z[at.clone()]];
                    strip.write(row, left, &depth[at], normal);
                }
            });
        });
    }
}

dispatched! {
    fn draw_buffers(buffers: &Buffers, config: &LineConfig, ink: &mut [u8]) {
        draw_strips(buffers.size, config, ink, |top, strip| {
            for row in 0..TILE.min(buffers.size - top) {
                let pixels = (top + row) * buffers.size..(top + row + 1) * buffers.size;
                let [x, y, z] = &buffers.normal;
                let normal = [&x[pixels.clone()], &y[pixels.clone()], &z[pixels.clone()]];
                strip.write(row, 0, &buffers.depth[pixels], normal);
            }
        });
    }
}

/// Pixels that are looked at together.
const BLOCK: usize = 16;
/// Rows of the strip before whose lines, or whose neighbours' lines, wait for the strip that follows.
const OVERLAP: usize = 2;

/// Some rows of an image, of what lines are found in; with a pixel of background at both ends of each.
///
/// A strip goes through the image from top to bottom, so that it stays in the nearest caches.
struct Strip {
    /// From one row to the next.
    stride: usize,
    /// Inverse depth; 0 where nothing is seen.
    near: Vec<f32>,
    /// Anything where nothing is seen.
    normal: [Vec<f32>; 3],
    /// The share of `FACE_ORDER` in the normal.
    rank: Vec<f32>,
}

/// Pixels side by side.
struct Block<'a> {
    near: &'a [f32; BLOCK],
    normal: [&'a [f32; BLOCK]; 3],
    rank: &'a [f32; BLOCK],
}

impl Strip {
    fn new(size: usize) -> Self {
        let stride = size.next_multiple_of(BLOCK) + 2;
        let blank = vec![0.0; (OVERLAP + TILE) * stride];
        Self { stride, near: blank.clone(), normal: [(); 3].map(|()| blank.clone()), rank: blank }
    }

    /// Keeps the last rows as the first, and clears the others.
    #[inline(always)]
    fn advance(&mut self) {
        for values in self.normal.iter_mut().chain([&mut self.near, &mut self.rank]) {
            values.copy_within(TILE * self.stride.., 0);
        }
        self.near[OVERLAP * self.stride..].fill(0.0);
    }

    /// Puts pixels into one of the new rows, from a column on.
    #[inline(always)]
    fn write(&mut self, row: usize, col: usize, depth: &[f32], normal: [&[f32]; 3]) {
        let from = (OVERLAP + row) * self.stride + 1 + col;
        let new = from..from + depth.len();
        self.near[new.clone()].iter_mut().zip(depth).for_each(|(near, depth)| *near = 1.0 / depth);
        for (own, normal) in self.normal.iter_mut().zip(normal) {
            own[new.clone()].copy_from_slice(normal);
        }
        let ranks = self.rank[new].iter_mut();
        let normals = normal[0].iter().zip(normal[1]).zip(normal[2]);
        ranks.zip(normals).for_each(|(rank, ((&x, &y), &z))| *rank = dot([x, y, z], FACE_ORDER));
    }

    /// Pixels of one row from `at` on; 0 is the one before the image.
    #[inline(always)]
    fn block(&self, row: usize, at: usize) -> Block<'_> {
        let from = row * self.stride + at;
        let [x, y, z] = &self.normal;
        Block {
            near: block(&self.near, from),
            normal: [block(x, from), block(y, from), block(z, from)],
            rank: block(&self.rank, from),
        }
    }
}

#[inline(always)]
fn block(values: &[f32], from: usize) -> &[f32; BLOCK] {
    values[from..].first_chunk().expect("rows are whole blocks")
}

/// Draws strip by strip; `fill` writes the rows from the given one on into a strip that is clear.
#[inline(always)]
fn draw_strips(size: usize, config: &LineConfig, ink: &mut [u8], mut fill: impl FnMut(usize, &mut Strip)) {
    let cos_crease = config.crease_degrees.to_radians().cos();
    let crease = |first: &Block, second: &Block| creases(first, second, cos_crease, config.depth_step);
    let mut strip = Strip::new(size);
    // What a row's pixels leave on themselves, on the ones to the right, and on the ones below.
    let [mut own, mut right, mut below, mut above] = [(); 4].map(|()| vec![0u8; strip.stride]);
    // Once more than there are strips, for the last row.
    for top in (0..=size).step_by(TILE) {
        strip.advance();
        if top < size {
            fill(top, &mut strip);
        }
        for row in top.max(1) - 1..size.min(top + TILE - 1) {
            let at = row + OVERLAP - top;
            for col in (0..size).step_by(BLOCK) {
                let here = strip.block(at, col + 1);
                let (mut marks, mut beside, mut beneath) = ([0; BLOCK], [0; BLOCK], [0; BLOCK]);
                if here.near.iter().fold(0, |any, near| any | near.to_bits()) != 0 {
                    let (next, under) = (strip.block(at, col + 2), strip.block(at + 1, col + 1));
                    let around = [block(&strip.near, at * strip.stride + col), next.near];
                    let across = [block(&strip.near, (at - 1) * strip.stride + col + 1), under.near];
                    marks = outlines(here.near, [around, across], config.depth_step);
                    let creases = [crease(&here, &next), crease(&here, &under)];
                    (0..BLOCK).for_each(|i| marks[i] |= creases[0].0[i] | creases[1].0[i]);
                    (beside, beneath) = (creases[0].1, creases[1].1);
                }
                own[col..col + BLOCK].copy_from_slice(&marks);
                right[col + 1..col + 1 + BLOCK].copy_from_slice(&beside);
                below[col..col + BLOCK].copy_from_slice(&beneath);
            }
            for (i, ink) in ink[row * size..(row + 1) * size].iter_mut().enumerate() {
                *ink = own[i] | right[i] | above[i];
            }
            std::mem::swap(&mut above, &mut below);
        }
    }
}

/// Ink on outlines and on steps of depth, from the pixels before and behind along either axis.
#[inline(always)]
fn outlines(here: &[f32; BLOCK], pairs: [[&[f32; BLOCK]; 2]; 2], depth_step: f32) -> [u8; BLOCK] {
    let mut ink = [0; BLOCK];
    for i in 0..BLOCK {
        let [[left, right], [above, below]] = pairs.map(|pair| pair.map(|near| near[i]));
        let outline = (left == 0.0) | (right == 0.0) | (above == 0.0) | (below == 0.0);
        let step = (2.0 * here[i] - left - right > depth_step) | (2.0 * here[i] - above - below > depth_step);
        ink[i] = if (here[i] != 0.0) & (outline | step) { 255 } else { 0 };
    }
    ink
}

/// The ink that creases between neighbours leave on the first ones and on the second ones.
///
/// A crease belongs to what is in front; where both are equally far, to the same face all along.
#[inline(always)]
fn creases(first: &Block, second: &Block, cos_crease: f32, depth_step: f32) -> ([u8; BLOCK], [u8; BLOCK]) {
    let (mut one, mut other) = ([0; BLOCK], [0; BLOCK]);
    for i in 0..BLOCK {
        let cosine = dot(first.normal.map(|n| n[i]), second.normal.map(|n| n[i]));
        let crease = (first.near[i] != 0.0) & (second.near[i] != 0.0) & (cosine < cos_crease);
        let ahead = first.near[i] - second.near[i];
        let level = (ahead <= depth_step) & (-ahead <= depth_step);
        let owns = (level & (first.rank[i] >= second.rank[i])) | (!level & (ahead > 0.0));
        one[i] = if crease & owns { 255 } else { 0 };
        other[i] = if crease & !owns { 255 } else { 0 };
    }
    (one, other)
}

/// Of two faces that meet in a crease, the one whose normal has more of this carries the line: tops before sides.
const FACE_ORDER: [f32; 3] = [0.32, 1.0, 0.11];

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size x size image from rows of characters: '.' background, digits distances, with one normal a digit.
    fn picture(rows: &[&str]) -> Buffers {
        let normals = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cells = || rows.iter().flat_map(|r| r.bytes());
        let digit = |c: u8| usize::from(c - b'0');
        Buffers {
            depth: cells()
                .map(|c| if c == b'.' { f32::INFINITY } else { 2.0 + 0.1 * digit(c) as f32 })
                .collect(),
            normal: [0, 1, 2].map(|axis| {
                cells().map(|c| if c == b'.' { 0.0 } else { normals[digit(c) % 3][axis] }).collect()
            }),
            size: rows.len(),
        }
    }

    fn ink(buffers: &Buffers, config: &LineConfig) -> Vec<u8> {
        let mut ink = vec![0; buffers.size * buffers.size];
        detect(buffers, config, &mut ink);
        ink
    }

    fn drawn(buffers: &Buffers, config: &LineConfig) -> Vec<String> {
        ink(buffers, config)
            .chunks(buffers.size)
            .map(|row| row.iter().map(|&v| if v > 0 { '#' } else { '.' }).collect())
            .collect()
    }

    fn turn_up(buffers: &mut Buffers, pixel: usize) {
        for (axis, value) in [0.0, 1.0, 0.0].into_iter().enumerate() {
            buffers.normal[axis][pixel] = value;
        }
    }

    #[test]
    fn outlines_lie_on_the_object() {
        let buffers = picture(&["......", ".0000.", ".0000.", ".0000.", ".0000.", "......"]);
        let expected = ["......", ".####.", ".#..#.", ".#..#.", ".####.", "......"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_step_is_drawn_once_on_the_nearer_side() {
        let mut buffers = picture(&["3333333"; 7]);
        for row in 2..5 {
            for col in 2..5 {
                buffers.depth[row * 7 + col] = 2.0;
            }
        }
        let expected = ["#######", "#.....#", "#.###.#", "#.#.#.#", "#.###.#", "#.....#", "#######"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_crease_is_one_pixel_wide() {
        let mut buffers = picture(&["0000000"; 7]);
        for row in 0..7 {
            for col in 4..7 {
                turn_up(&mut buffers, row * 7 + col);
            }
        }
        // The face whose normal points up carries it.
        let expected = ["#######", "#...#.#", "#...#.#", "#...#.#", "#...#.#", "#...#.#", "#######"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_slanted_crease_is_one_pixel_wide_either_way() {
        for rising in [false, true] {
            let mut buffers = picture(&["000000000"; 9]);
            for row in 0..9 {
                for col in 0..9 {
                    if (if rising { 8 - row } else { row }) < col {
                        turn_up(&mut buffers, row * 9 + col);
                    }
                }
            }
            let ink = ink(&buffers, &LineConfig::default());
            let inner = (1..8).flat_map(|row| (1..8).map(move |col| row * 9 + col));
            // Not counting the outline: along a diagonal of seven inner rows, one pixel a row.
            assert_eq!(inner.filter(|&i| ink[i] > 0).count(), 6, "rising: {rising}");
        }
    }
}
