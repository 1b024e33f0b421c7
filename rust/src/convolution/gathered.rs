//! Convolutions as one product of matrices: what an output reads is gathered into a row.

use super::memory::{Aligned, with_scratch};
use super::product::{Panels, Rows, Target, multiply_panels};
use super::vector::Instructions;
use rayon::prelude::*;

/// Floats that are gathered at a time: a quarter of a core's cache of 2 MB.
const AT_ONCE: usize = 1 << 17;

pub(super) struct Gathered {
    panels: Panels,
    bias: Aligned,
    inputs: usize,
    /// Cells along each axis that an output reads.
    taps: [usize; 3],
    /// Cells from output to output.
    stride: [usize; 3],
    /// Cells of zeros before the grid.
    padding: [usize; 3],
}

impl Gathered {
    /// `weight`: outputs x inputs x taps.
    pub fn new(
        instructions: Instructions,
        weight: &[f32],
        bias: &[f32],
        [inputs, outputs]: [usize; 2],
        [taps, stride, padding]: [[usize; 3]; 3],
    ) -> Self {
        let count = taps.iter().product::<usize>();
        let panels = Panels::new(instructions, count * inputs, outputs, |row, output| {
            weight[(output * inputs + row % inputs) * count + row / inputs]
        });
        let mut kept = Aligned::zeros(bias.len());
        kept.copy_from_slice(bias);
        Self { panels, bias: kept, inputs, taps, stride, padding }
    }

    pub fn output_size(&self, size: [usize; 3]) -> [usize; 3] {
        std::array::from_fn(|a| {
            (size[a] + 2 * self.padding[a]).saturating_sub(self.taps[a] - 1).div_ceil(self.stride[a])
        })
    }

    pub fn apply(&self, input: &[f32], size: [usize; 3], rectify: bool, add: bool, out: &mut [f32]) {
        let [outputs, depth] = [self.panels.columns, self.panels.depth];
        let [_, cols, depths] = self.output_size(size);
        let count = out.len() / outputs;
        let fair = count.div_ceil(4 * rayon::current_num_threads());
        let at_once = (AT_ONCE / depth.max(1)).min(fair).max(14);
        let as_it_is = !rectify && self.taps == [1; 3];
        out.par_chunks_mut(at_once * outputs).enumerate().for_each(|(nth, out)| {
            let cells = nth * at_once..nth * at_once + out.len() / outputs;
            let target = Target { values: out, stride: outputs, add, bias: &self.bias };
            if as_it_is {
                let values = &input[cells.start * depth..cells.end * depth];
                let rows = Rows { values, stride: depth, count: cells.len() };
                return multiply_panels(rows, self.panels.as_ref(), target);
            }
            let stride = depth + 16;
            with_scratch(cells.len() * stride, |scratch| {
                for (row, cell) in scratch.chunks_exact_mut(stride).zip(cells.clone()) {
                    let line = cell / depths;
                    let place = [line / cols, line % cols, cell % depths];
                    self.gather(input, size, place, rectify, &mut row[..depth]);
                }
                let rows = Rows { values: scratch, stride, count: cells.len() };
                multiply_panels(rows, self.panels.as_ref(), target);
            });
        });
    }

    /// What the output at a place reads, tap by tap.
    fn gather(&self, input: &[f32], size: [usize; 3], place: [usize; 3], rectify: bool, row: &mut [f32]) {
        let mut row = row.chunks_exact_mut(self.inputs);
        // Beyond the first cell they wrap around to large numbers.
        let at = |a: usize, tap: usize| (place[a] * self.stride[a] + tap).wrapping_sub(self.padding[a]);
        for i in 0..self.taps[0] {
            for j in 0..self.taps[1] {
                for (k, to) in (0..self.taps[2]).zip(&mut row) {
                    let [i, j, k] = [at(0, i), at(1, j), at(2, k)];
                    if i >= size[0] || j >= size[1] || k >= size[2] {
                        to.fill(0.0);
                        continue;
                    }
                    let from = &input[((i * size[1] + j) * size[2] + k) * self.inputs..][..self.inputs];
                    if rectify {
                        to.iter_mut()
                            .zip(from)
                            .for_each(|(to, &from)| *to = if from < 0.0 { 0.0 } else { from });
                    } else {
                        to.copy_from_slice(from);
                    }
                }
            }
        }
    }
}
