//! Saito-Takahashi lines: an edge detector over depth and normal buffers (paper, section 4.2).
//!
//! Profile edges come from the second difference of *inverse* depth, which is zero on every plane at every
//! slant; creases from the angle between normals. Every line pixel lies on the object, and every object pixel
//! beside the background is a line: so outlines are closed, and the background, flooded over its four-connected
//! neighbours from the border, never gets in.

use crate::buffers::{Buffers, Pixels, image_points};
use crate::camera::{Camera, IMAGE};
use crate::csg::Shape;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::raycast::{RAYS, RayCaster, TILE, Tile};
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

for_each_instruction_set! {
    fn draw_seen(caster: &RayCaster, config: &LineConfig, ink: &mut [u8]) {
        draw_tiles(caster, config, ink);
    }
}

for_each_instruction_set! {
    fn draw_buffers(buffers: &Buffers, config: &LineConfig, ink: &mut [u8]) {
        draw_rows(buffers, config, ink);
    }
}

#[inline(always)]
fn draw_tiles(caster: &RayCaster, config: &LineConfig, ink: &mut [u8]) {
    let mut tile = Tile::new(caster);
    let mut strip = Strip::new(IMAGE);
    for top in (0..IMAGE).step_by(TILE) {
        strip.advance();
        tile.choose(caster, &image_points(top, IMAGE));
        for left in (0..IMAGE).step_by(TILE) {
            if let Some(pixels) = Pixels::seen(caster, &mut tile, &image_points(left, IMAGE)) {
                strip.write(left, &pixels);
            }
        }
        strip.draw(top, config, ink);
    }
    strip.advance();
    strip.draw(IMAGE, config, ink);
}

#[inline(always)]
fn draw_rows(buffers: &Buffers, config: &LineConfig, ink: &mut [u8]) {
    let size = buffers.size;
    let mut strip = Strip::new(size);
    for top in (0..size).step_by(TILE) {
        strip.advance();
        for left in (0..size).step_by(TILE) {
            if let Some(pixels) = buffers.tile(left, top) {
                strip.write(left, &pixels);
            }
        }
        strip.draw(top, config, ink);
    }
    strip.advance();
    strip.draw(size.next_multiple_of(TILE), config, ink);
}

/// Pixels that are looked at together.
const BLOCK: usize = 16;
/// Rows of the strip before whose lines, or whose neighbours' lines, wait for the strip that follows.
const OVERLAP: usize = 2;

/// Some rows of an image, of what lines are found in.
///
/// A strip goes through the image from top to bottom, so that it stays in the nearest caches.
struct Strip {
    size: usize,
    /// Row by row, with a block of background at both ends of each.
    blocks: Vec<Block>,
    /// Blocks from one row to the next.
    stride: usize,
    /// The ink that the row above leaves on the row to be drawn next.
    beneath: Vec<[u8; BLOCK]>,
}

/// Pixels side by side.
#[derive(Clone, Copy)]
struct Block {
    /// Inverse depth; 0 where nothing is seen.
    near: [f32; BLOCK],
    /// Anything where nothing is seen.
    normal: [[f32; BLOCK]; 3],
    /// The share of `FACE_ORDER` in the normal.
    rank: [f32; BLOCK],
}

impl Strip {
    fn new(size: usize) -> Self {
        let stride = size.div_ceil(BLOCK) + 2;
        let blank = [0.0; BLOCK];
        let blank = Block { near: blank, normal: [blank; 3], rank: blank };
        let blocks = vec![blank; (OVERLAP + TILE) * stride];
        Self { size, blocks, stride, beneath: vec![[0; BLOCK]; stride] }
    }

    /// Keeps the last rows as the first, and clears the others.
    #[inline(always)]
    fn advance(&mut self) {
        self.blocks.copy_within(TILE * self.stride.., 0);
        for block in &mut self.blocks[OVERLAP * self.stride..] {
            block.near = [0.0; BLOCK];
        }
    }

    /// Puts a tile of pixels into the new rows, from a column on.
    #[inline(always)]
    fn write(&mut self, left: usize, pixels: &Pixels) {
        let Pixels { depth, normal } = pixels;
        let (mut near, mut rank) = ([0.0; RAYS], [0.0; RAYS]);
        for i in 0..RAYS {
            near[i] = 1.0 / depth[i];
            rank[i] = dot([normal[0][i], normal[1][i], normal[2][i]], FACE_ORDER);
        }
        for row in 0..TILE {
            let block = &mut self.blocks[(OVERLAP + row) * self.stride + 1 + left / BLOCK];
            let part = left % BLOCK / TILE;
            let Block { near: own_near, normal: [x, y, z], rank: own_rank } = block;
            let [nx, ny, nz] = normal;
            for (values, own) in [(&near, own_near), (nx, x), (ny, y), (nz, z), (&rank, own_rank)] {
                own.as_chunks_mut::<TILE>().0[part] = values.as_chunks::<TILE>().0[row];
            }
        }
    }

    /// Draws the rows that have all of their neighbours, of the strip whose first new row is `top`.
    #[inline(always)]
    fn draw(&mut self, top: usize, config: &LineConfig, ink: &mut [u8]) {
        let cos_crease = config.crease_degrees.to_radians().cos();
        for row in top.max(1) - 1..self.size.min(top + TILE - 1) {
            let mut beside = [0; BLOCK];
            for k in 1..self.stride - 1 {
                let at = (row + OVERLAP - top) * self.stride + k;
                let here = &self.blocks[at];
                let mut marks = self.beneath[k];
                if here.near.iter().fold(0, |any, near| any | near.to_bits()) == 0 {
                    (marks, beside, self.beneath[k]) = ([0; BLOCK], [0; BLOCK], [0; BLOCK]);
                } else {
                    let (above, below) = (&self.blocks[at - self.stride], &self.blocks[at + self.stride]);
                    let right = here.shifted(&self.blocks[at + 1]);
                    let left = shifted_back(&self.blocks[at - 1].near, &here.near);
                    let step = config.depth_step;
                    let (sideways, upright) =
                        (creases(here, &right, cos_crease, step), creases(here, below, cos_crease, step));
                    let passed_on = shifted_back(&beside, &sideways.1);
                    let outlines = outlines(&here.near, [&left, &right.near, &above.near, &below.near], step);
                    for i in 0..BLOCK {
                        marks[i] |= outlines[i] | passed_on[i] | sideways.0[i] | upright.0[i];
                    }
                    (beside, self.beneath[k]) = (sideways.1, upright.1);
                }
                let from = (k - 1) * BLOCK;
                let ink = &mut ink[row * self.size + from..(row + 1) * self.size];
                match ink.first_chunk_mut() {
                    Some(whole) => *whole = marks,
                    None => ink.copy_from_slice(&marks[..ink.len()]),
                }
            }
        }
    }
}

impl Block {
    /// The pixels to the right of these, `next` being the block there.
    #[inline(always)]
    fn shifted(&self, next: &Self) -> Self {
        Self {
            near: shifted(&self.near, &next.near),
            normal: [
                shifted(&self.normal[0], &next.normal[0]),
                shifted(&self.normal[1], &next.normal[1]),
                shifted(&self.normal[2], &next.normal[2]),
            ],
            rank: shifted(&self.rank, &next.rank),
        }
    }
}

/// All values but the first, and the first of the block that follows.
#[inline(always)]
fn shifted<T: Copy>(values: &[T; BLOCK], next: &[T; BLOCK]) -> [T; BLOCK] {
    let mut result = [next[0]; BLOCK];
    result[..BLOCK - 1].copy_from_slice(&values[1..]);
    result
}

/// The last value of the block before, and all but the last.
#[inline(always)]
fn shifted_back<T: Copy>(last: &[T; BLOCK], values: &[T; BLOCK]) -> [T; BLOCK] {
    let mut result = [last[BLOCK - 1]; BLOCK];
    result[1..].copy_from_slice(&values[..BLOCK - 1]);
    result
}

/// Ink on outlines and on steps of depth, from what is to the left, to the right, above and below.
#[inline(always)]
fn outlines(here: &[f32; BLOCK], around: [&[f32; BLOCK]; 4], depth_step: f32) -> [u8; BLOCK] {
    let mut ink = [0; BLOCK];
    for i in 0..BLOCK {
        let (left, right, above, below) = (around[0][i], around[1][i], around[2][i], around[3][i]);
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
    let ([a, b, c], [x, y, z]) = (&first.normal, &second.normal);
    for i in 0..BLOCK {
        let cosine = dot([a[i], b[i], c[i]], [x[i], y[i], z[i]]);
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
    use crate::camera::VIEWPOINTS;
    use crate::grammar::GrammarConfig;
    use crate::random::Random;

    /// A size x size image from rows of characters: '.' background, digits distances, with one normal a digit.
    fn picture(rows: &[&str]) -> Buffers {
        let normals = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cells = || rows.iter().flat_map(|r| r.bytes());
        let digit = |c: u8| usize::from(c - b'0');
        Buffers {
            depth: cells()
                .map(|c| if c == b'.' { f32::INFINITY } else { 2.0 + 0.1 * digit(c) as f32 })
                .collect(),
            normal: cells().map(|c| if c == b'.' { [0.0; 3] } else { normals[digit(c) % 3] }).collect(),
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

    #[test]
    fn every_instruction_set_draws_the_same() {
        let (config, grammar) =
            (LineConfig::default(), GrammarConfig { wedges: 0.2, ..GrammarConfig::default() });
        for (i, (azimuth, elevation)) in (0..).zip(VIEWPOINTS) {
            let (shape, _) = grammar.draw(&mut Random::new(6, i, 0)).unwrap();
            let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
            let (mut best, mut baseline) = (vec![1; IMAGE * IMAGE], vec![2; IMAGE * IMAGE]);
            draw(&shape, &camera, &config, &mut best).unwrap();
            draw_tiles(&RayCaster::new(&shape, &camera).unwrap(), &config, &mut baseline);
            assert!(best.contains(&255) && best == baseline);
            let buffers = Buffers::of_shape(&shape, &camera, IMAGE).unwrap();
            assert!(best == ink(&buffers, &config));
            draw_rows(&buffers, &config, &mut baseline);
            assert!(best == baseline);
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
                buffers.normal[row * 7 + col] = [0.0, 1.0, 0.0];
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
                        buffers.normal[row * 9 + col] = [0.0, 1.0, 0.0];
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
