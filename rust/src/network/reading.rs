//! What every cell of the world grid reads in all drawings, and what the decoder's first layer makes of it.

use super::widths::Widths;
use crate::camera::Camera;
use crate::convolution::Convolution;
use crate::dispatch::for_each_instruction_set;
use crate::lift::{COARSE, HALF, read};
use crate::voxel::SIDE;
use rayon::prelude::*;

/// Voxels of a cell.
pub const VOXELS: usize = 8;
/// Volumes of evidence.
pub const EVIDENCE: usize = 3;
/// Bytes of the evidence of one object.
pub const BYTES: usize = EVIDENCE * VOXELS * HALF;
/// What the first layer takes of a cell: what it has read, evidence, the prior, and its place.
pub fn inputs(widths: &Widths) -> usize {
    2 * widths.fused + VOXELS * EVIDENCE + VOXELS + 3
}

/// Voxels along z of the half grid.
const DEEP: usize = SIDE / 2;
/// Cells of a plane x = constant of the half grid: threads take one at a time.
const CELLS: usize = HALF / COARSE;

/// The layer that reads a drawing, and the decoder's first layer, which is linear: the prior's share of it is left to
/// whoever has one.
pub struct Reading {
    each: Convolution,
    first: Convolution,
    features: usize,
    fused: usize,
}

impl Reading {
    /// From the layer that reads, and the weight, outputs x `inputs`, and the bias of the first layer.
    pub fn new(each: Convolution, weight: &[f32], bias: &[f32], widths: &Widths) -> Self {
        let seen = 2 * widths.fused + VOXELS * EVIDENCE;
        let rows = weight.chunks_exact(inputs(widths));
        let known: Vec<f32> = rows.flat_map(|row| [&row[..seen], &row[seen + VOXELS..]].concat()).collect();
        let first = Convolution::point(&known, bias, seen + 3, bias.len());
        Self { each, first, features: widths.features, fused: widths.fused }
    }

    /// Room for what all cells read in all drawings of an object: sums, then the largest.
    pub fn room(&self) -> Vec<f32> {
        vec![0.0; HALF * 2 * self.fused]
    }

    /// Adds what cells read in a drawing's features, `ENTRIES` x features, to what they have read in those before.
    pub fn add(&self, camera: &Camera, features: &[f32], is_first: bool, seen: &mut [f32]) {
        let room = || (vec![0.0; CELLS * 2 * self.features], vec![0.0; CELLS * self.fused]);
        let planes = seen.par_chunks_mut(CELLS * 2 * self.fused).enumerate();
        planes.for_each_init(room, |(lifted, each), (x, seen)| {
            read(camera, features, self.features, x, lifted);
            self.each.apply(lifted, [CELLS, 1, 1], false, false, each);
            if is_first {
                begin(each, self.fused, seen);
            } else {
                go_on(each, self.fused, seen);
            }
        });
    }

    /// What the first layer makes of what was read in so many drawings, of evidence (`BYTES` of it) and of every cell's
    /// place: `HALF` x its outputs.
    pub fn finish(&self, seen: &[f32], drawings: usize, evidence: &[u8], out: &mut [f32]) {
        assert_eq!(evidence.len(), BYTES);
        let (inputs, share) = (self.first.inputs(), 1.0 / drawings as f32);
        let planes =
            seen.par_chunks(CELLS * 2 * self.fused).zip(out.par_chunks_mut(CELLS * self.first.outputs()));
        planes.enumerate().for_each_init(
            || vec![0.0; CELLS * inputs],
            |known, (x, (seen, out))| {
                let cells = known.chunks_exact_mut(inputs).zip(seen.chunks_exact(2 * self.fused));
                for (cell, (known, seen)) in cells.enumerate() {
                    known[..seen.len()].copy_from_slice(seen);
                    known[..self.fused].iter_mut().for_each(|sum| *sum *= share);
                    known[inputs - 3..].copy_from_slice(&place([
                        x,
                        cell / (COARSE / 2),
                        cell % (COARSE / 2),
                    ]));
                }
                fold_plane(evidence, x, known, inputs, 2 * self.fused);
                self.first.apply(known, [CELLS, 1, 1], false, false, out);
            },
        );
    }
}

/// Where the centre of a cell is.
fn place([x, y, z]: [usize; 3]) -> [f32; 3] {
    let at = |i: usize| (i as f64 + 0.5) / COARSE as f64;
    [(at(x) - 0.5) as f32, (at(y) - 0.5) as f32, at(z) as f32]
}

/// The evidence of a plane of cells in 0..1, from channel `first` on: the eight voxels of each become channels.
fn fold_plane(evidence: &[u8], x: usize, out: &mut [f32], width: usize, first: usize) {
    for (volume, evidence) in evidence.chunks_exact(BYTES / EVIDENCE).enumerate() {
        for (corner, line) in
            evidence[2 * x * SIDE * DEEP..][..2 * SIDE * DEEP].chunks_exact(DEEP).enumerate()
        {
            let (dx, y, dy) = (corner / SIDE, corner % SIDE / 2, corner % 2);
            let channel = first + volume * VOXELS + dx * 4 + dy * 2;
            let cells = out[y * (COARSE / 2) * width..][..COARSE / 2 * width].chunks_exact_mut(width);
            for (cell, pair) in cells.zip(line.as_chunks::<2>().0) {
                cell[channel] = f32::from(pair[0]) / 255.0;
                cell[channel + 1] = f32::from(pair[1]) / 255.0;
            }
        }
    }
}

for_each_instruction_set! {
/// What is read in a first drawing: the sum and the largest of one.
fn begin(each: &[f32], width: usize, seen: &mut [f32]) {
    for (each, seen) in each.chunks_exact(width).zip(seen.chunks_exact_mut(2 * width)) {
        let (sum, most) = seen.split_at_mut(width);
        for ((each, sum), most) in each.iter().zip(sum).zip(most) {
            *sum = if *each < 0.0 { 0.0 } else { *each };
            *most = *sum;
        }
    }
}
}

for_each_instruction_set! {
fn go_on(each: &[f32], width: usize, seen: &mut [f32]) {
    for (each, seen) in each.chunks_exact(width).zip(seen.chunks_exact_mut(2 * width)) {
        let (sum, most) = seen.split_at_mut(width);
        for ((each, sum), most) in each.iter().zip(sum).zip(most) {
            let each = if *each < 0.0 { 0.0 } else { *each };
            *sum += each;
            *most = if each > *most { each } else { *most };
        }
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eight_voxels_of_a_cell_become_channels() {
        let evidence: Vec<u8> = (0..BYTES).map(|i| (i * 89 % 253) as u8).collect();
        let (x, width, first) = (11, 30, 4);
        let mut out = vec![-1.0; CELLS * width];
        fold_plane(&evidence, x, &mut out, width, first);
        for (i, got) in out.iter().enumerate() {
            let (y, z, channel) = (i / width / 16, i / width % 16, i % width);
            let expected = channel.checked_sub(first).filter(|c| *c < 24).map_or(-1.0, |channel| {
                let (volume, corner) = (channel / 8, channel % 8);
                let voxel =
                    (2 * x + corner / 4) * 64 * 32 + (2 * y + corner / 2 % 2) * 32 + 2 * z + corner % 2;
                f32::from(evidence[volume * 64 * 64 * 32 + voxel]) / 255.0
            });
            assert_eq!(*got, expected);
        }
    }

    #[test]
    fn sums_and_largest_are_of_what_is_positive() {
        let mut seen = [9.0; 4];
        begin(&[1.0, -2.0], 2, &mut seen);
        assert_eq!(seen, [1.0, 0.0, 1.0, 0.0]);
        go_on(&[0.5, 3.0], 2, &mut seen);
        go_on(&[-0.5, 1.0], 2, &mut seen);
        assert_eq!(seen, [1.5, 4.0, 1.0, 3.0]);
    }

    #[test]
    fn cells_are_where_they_are_in_the_world() {
        assert_eq!(place([0, 31, 0]), [-0.484375, 0.484375, 0.015625]);
        assert_eq!(place([16, 15, 15]), [0.015625, -0.015625, 0.484375]);
    }
}
