//! What the networks for images and for volumes are made of.

use super::dense::Dense;
use super::norm::GroupNorm;
use super::weights::Weights;
use crate::convolution::Convolution;
use crate::error::CoreError;
use rayon::prelude::*;

/// Two convolutions of 3 cells a side around a normalisation that a code scales and shifts.
pub struct Block {
    conv1: Convolution,
    norm: GroupNorm,
    film: Dense,
    conv2: Convolution,
}

/// The sides of all blocks of an encoder or a decoder.
#[derive(Clone, Copy)]
pub struct Kind {
    pub axes: usize,
    pub groups: usize,
    /// Numbers of the code.
    pub code: usize,
}

impl Block {
    pub fn of(weights: &mut Weights<'_>, name: &str, width: usize, kind: Kind) -> Result<Self, CoreError> {
        let Kind { axes, groups, code } = kind;
        Ok(Self {
            conv1: weights.three(&format!("{name}.conv1"), [width; 2], axes, false)?,
            norm: GroupNorm::of(weights, &format!("{name}.norm"), width, groups)?,
            film: Dense::of(weights, &format!("{name}.film"), code, 2 * width)?,
            conv2: weights.three(&format!("{name}.conv2"), [width; 2], axes, true)?,
        })
    }

    /// Adds to cells x channels what the block makes of them. `scratch` is as long, or longer.
    pub fn apply(&self, x: &mut [f32], size: [usize; 3], code: &[f32], scratch: &mut [f32]) {
        let inner = &mut scratch[..x.len()];
        self.conv1.apply(x, size, true, false, inner);
        self.norm.apply(inner, &self.film.apply(code));
        self.conv2.apply(inner, size, true, true, x);
    }
}

/// Adds to each cell what the cell of half the size has that it lies in; `size` is that of the smaller image (its last
/// side is 1) or volume.
pub fn add_twice(coarse: &[f32], size: [usize; 3], out: &mut [f32]) {
    let [rows, cols, deep] = size;
    let width = coarse.len() / (rows * cols * deep);
    let depths = if deep == 1 { 1 } else { 2 * deep };
    assert_eq!(out.len(), 4 * rows * cols * depths * width);
    out.par_chunks_mut(2 * cols * depths * width).enumerate().for_each(|(row, out)| {
        for (cell, out) in out.chunks_exact_mut(width).enumerate() {
            let (col, depth) = (cell / depths / 2, cell % depths * deep / depths);
            let coarse = &coarse[((row / 2 * cols + col) * deep + depth) * width..][..width];
            out.iter_mut().zip(coarse).for_each(|(o, c)| *o += c);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_doubled_along_each_side() {
        let coarse: Vec<f32> = (0..2 * 3 * 4 * 5).map(|i| i as f32).collect();
        let mut out = vec![1.0; 8 * coarse.len()];
        add_twice(&coarse, [2, 3, 4], &mut out);
        for (i, got) in out.iter().enumerate() {
            let (x, y, z, c) = (i / 5 / 8 / 6, i / 5 / 8 % 6, i / 5 % 8, i % 5);
            assert_eq!(*got, 1.0 + coarse[((x / 2 * 3 + y / 2) * 4 + z / 2) * 5 + c]);
        }
        let mut out = vec![0.0; 4 * coarse.len()];
        add_twice(&coarse, [4, 6, 1], &mut out);
        for (i, got) in out.iter().enumerate() {
            let (row, col, c) = (i / 5 / 12, i / 5 % 12, i % 5);
            assert_eq!(*got, coarse[(row / 2 * 6 + col / 2) * 5 + c]);
        }
    }
}
