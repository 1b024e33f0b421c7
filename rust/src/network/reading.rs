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
/// What is known of a cell besides: evidence and its place.
const KNOWN: usize = VOXELS * EVIDENCE + 3;
/// What the first layer takes of a cell: what it has read, evidence, the prior, and its place.
pub fn inputs(widths: &Widths) -> usize {
    2 * widths.fused + KNOWN + VOXELS
}

/// Voxels along z of the half grid.
const DEEP: usize = SIDE / 2;
/// Cells of a plane x = constant of the half grid: threads take one at a time.
const CELLS: usize = HALF / COARSE;

/// The layer that reads a drawing, and the decoder's first layer, which is linear: the prior's share of it is left to
/// whoever has one.
pub struct Reading {
    each: Convolution,
    /// The first layer's share of what was read, and that of evidence and place.
    first: [Convolution; 2],
    features: usize,
    fused: usize,
}

impl Reading {
    /// From the layer that reads, and the weight, outputs x `inputs`, and the bias of the first layer.
    pub fn new(each: Convolution, weight: &[f32], bias: &[f32], widths: &Widths) -> Self {
        let seen = 2 * widths.fused;
        let prior = seen + KNOWN - 3;
        let (mut of_seen, mut of_known) = (Vec::new(), Vec::new());
        for row in weight.chunks_exact(inputs(widths)) {
            of_seen.extend(&row[..seen]);
            of_known.extend(row[seen..prior].iter().map(|w| w / 255.0)); // evidence comes as whole numbers
            of_known.extend(&row[prior + VOXELS..]);
        }
        let of_seen = Convolution::point(&of_seen, bias, seen, bias.len());
        let of_known = Convolution::point(&of_known, &[], KNOWN, bias.len());
        Self { each, first: [of_seen, of_known], features: widths.features, fused: widths.fused }
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
    pub fn finish(&self, seen: &mut [f32], drawings: usize, evidence: &[u8], out: &mut [f32]) {
        assert_eq!(evidence.len(), BYTES);
        let share = 1.0 / drawings as f32;
        let planes = seen.par_chunks_mut(CELLS * 2 * self.fused);
        let planes = planes.zip(out.par_chunks_mut(CELLS * self.first[0].outputs())).enumerate();
        planes.for_each_init(
            || vec![[0.0; KNOWN]; CELLS],
            |known, (x, (seen, out))| {
                if drawings > 1 {
                    let cells = seen.chunks_exact_mut(2 * self.fused);
                    cells.for_each(|cell| cell[..self.fused].iter_mut().for_each(|sum| *sum *= share));
                }
                know(evidence, x, known);
                self.first[0].apply(seen, [CELLS, 1, 1], false, false, out);
                self.first[1].apply(known.as_flattened(), [CELLS, 1, 1], false, true, out);
            },
        );
    }
}

/// Where the centre of a cell is.
#[inline(always)]
fn place([x, y, z]: [usize; 3]) -> [f32; 3] {
    let at = |i: usize| (i as f64 + 0.5) / COARSE as f64;
    [(at(x) - 0.5) as f32, (at(y) - 0.5) as f32, at(z) as f32]
}

for_each_instruction_set! {
/// What is known of each cell of a plane: the evidence of its eight voxels, volume by volume, and its place.
fn know(evidence: &[u8], x: usize, out: &mut [[f32; KNOWN]]) {
    for (y, cells) in out.chunks_exact_mut(COARSE / 2).enumerate() {
        // Lines of voxels along z, two along x and two along y of each volume.
        let lines: [&[[u8; 2]]; EVIDENCE * 4] = std::array::from_fn(|i| {
            let row = i / 4 * SIDE * SIDE + (2 * x + i / 2 % 2) * SIDE + 2 * y + i % 2;
            evidence[row * DEEP..][..DEEP].as_chunks().0
        });
        for (z, cell) in cells.iter_mut().enumerate() {
            for (line, pair) in lines.iter().zip(cell.as_chunks_mut::<2>().0) {
                *pair = line[z].map(f32::from);
            }
            cell[KNOWN - 3..].copy_from_slice(&place([x, y, z]));
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
        let x = 11;
        let mut out = vec![[-1.0; KNOWN]; CELLS];
        know(&evidence, x, &mut out);
        for (cell, known) in out.iter().enumerate() {
            let (y, z) = (cell / 16, cell % 16);
            for (channel, got) in known[..24].iter().enumerate() {
                let (volume, corner) = (channel / 8, channel % 8);
                let voxel =
                    (2 * x + corner / 4) * 64 * 32 + (2 * y + corner / 2 % 2) * 32 + 2 * z + corner % 2;
                assert_eq!(*got, f32::from(evidence[volume * 64 * 64 * 32 + voxel]));
            }
            assert_eq!(known[24..], place([x, y, z]));
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
