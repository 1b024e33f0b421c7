//! Convolutions of a network, in 32-bit floats.
//!
//! Tensors are `cells x channels`, cells in C order. Layers of three cells a side multiply less than their formula does
//! (`winograd.rs`); others are a product of matrices (`gathered.rs`). Both end in blocks of sums that are as large as
//! the registers (`product.rs`), written for AVX-512, AVX2 and any processor (`vector.rs`).
//!
//! A result does not depend on the number of threads. It differs in the last digits between instruction sets.

mod gathered;
mod gradient;
mod memory;
mod product;
mod tiles;
mod transform;
mod vector;
mod winograd;

pub use gradient::{filter_gradient, input_gradient};

use gathered::Gathered;
use memory::with_scratch;
use product::{Panels, PanelsRef, Rows, Target, fill, multiply_panels};
use vector::Instructions;
use winograd::Winograd;

/// A layer: its weights, as its algorithm reads them.
pub struct Convolution {
    inputs: usize,
    outputs: usize,
    way: Way,
}

enum Way {
    Winograd(Winograd),
    Gathered(Gathered),
}

impl Convolution {
    /// Three cells a side, stride 1, one cell of zeros around. `axes` is 2 (images: `size` is [rows, cols, 1]) or 3.
    ///
    /// `weight` is outputs x inputs x 3 x 3 (x 3), `bias` outputs or empty.
    pub fn three(weight: &[f32], bias: &[f32], inputs: usize, outputs: usize, axes: usize) -> Self {
        Self::three_by(Instructions::best(), weight, bias, [inputs, outputs], axes)
    }

    /// Stride 2. Images: 3 x 3 cells, one cell of zeros around; volumes: 2 x 2 x 2, and none.
    pub fn halving(weight: &[f32], bias: &[f32], inputs: usize, outputs: usize, axes: usize) -> Self {
        Self::halving_by(Instructions::best(), weight, bias, [inputs, outputs], axes)
    }

    /// One cell: a linear layer over channels. `weight` is outputs x inputs.
    pub fn point(weight: &[f32], bias: &[f32], inputs: usize, outputs: usize) -> Self {
        Self::point_by(Instructions::best(), weight, bias, [inputs, outputs])
    }

    fn three_by(by: Instructions, weight: &[f32], bias: &[f32], channels: [usize; 2], axes: usize) -> Self {
        assert!(axes == 2 || axes == 3);
        check(weight, bias, channels, 3usize.pow(axes as u32));
        let [inputs, outputs] = channels;
        let tile = Winograd::tile(inputs, outputs, axes);
        let way = Way::Winograd(Winograd::new(by, weight, bias, inputs, outputs, tile));
        Self { inputs, outputs, way }
    }

    fn halving_by(by: Instructions, weight: &[f32], bias: &[f32], channels: [usize; 2], axes: usize) -> Self {
        assert!(axes == 2 || axes == 3);
        let [inputs, outputs] = channels;
        let shape = if axes == 2 { [[3, 3, 1], [2, 2, 1], [1, 1, 0]] } else { [[2; 3], [2; 3], [0; 3]] };
        check(weight, bias, channels, shape[0].iter().product());
        Self { inputs, outputs, way: Way::Gathered(Gathered::new(by, weight, bias, channels, shape)) }
    }

    fn point_by(by: Instructions, weight: &[f32], bias: &[f32], channels: [usize; 2]) -> Self {
        let [inputs, outputs] = channels;
        check(weight, bias, channels, 1);
        let shape = [[1; 3], [1; 3], [0; 3]];
        Self { inputs, outputs, way: Way::Gathered(Gathered::new(by, weight, bias, channels, shape)) }
    }

    /// Convolves `input`, cells of `size` x inputs, into `out`, cells of `output_size(size)` x outputs, on the threads
    /// of rayon's current pool. If `rectify`, negative inputs are taken for 0; if `add`, the result is added to what
    /// `out` holds.
    pub fn apply(&self, input: &[f32], size: [usize; 3], rectify: bool, add: bool, out: &mut [f32]) {
        self.apply_to_all(1, input, size, rectify, add, out);
    }

    /// Does so for `samples` grids, one after the other in memory.
    pub fn apply_to_all(
        &self,
        samples: usize,
        input: &[f32],
        size: [usize; 3],
        rectify: bool,
        add: bool,
        out: &mut [f32],
    ) {
        let read = size.iter().product::<usize>() * self.inputs;
        let written = self.output_size(size).iter().product::<usize>() * self.outputs;
        assert_eq!((input.len(), out.len()), (samples * read, samples * written));
        if out.is_empty() {
            return;
        }
        match &self.way {
            Way::Winograd(way) => way.apply(samples, input, size, rectify, add, out),
            Way::Gathered(way) => {
                let samples = input.chunks(read).zip(out.chunks_mut(written));
                samples.for_each(|(input, out)| way.apply(input, size, rectify, add, out));
            }
        }
    }

    pub fn output_size(&self, size: [usize; 3]) -> [usize; 3] {
        match &self.way {
            Way::Winograd(_) => size,
            Way::Gathered(way) => way.output_size(size),
        }
    }

    pub fn inputs(&self) -> usize {
        self.inputs
    }

    pub fn outputs(&self) -> usize {
        self.outputs
    }
}

fn check(weight: &[f32], bias: &[f32], [inputs, outputs]: [usize; 2], taps: usize) {
    assert!(inputs > 0 && outputs > 0);
    assert_eq!(weight.len(), outputs * inputs * taps);
    assert!(bias.is_empty() || bias.len() == outputs);
}

/// Multiplies `a`, m x k, by `b`, k x n, into `out`, m x n; if `add`, the product is added to what `out` holds.
pub fn multiply(a: &[f32], b: &[f32], m: usize, k: usize, n: usize, add: bool, out: &mut [f32]) {
    multiply_by(Instructions::best(), a, b, [m, k, n], add, out);
}

fn multiply_by(by: Instructions, a: &[f32], b: &[f32], [m, k, n]: [usize; 3], add: bool, out: &mut [f32]) {
    assert_eq!((a.len(), b.len(), out.len()), (m * k, k * n, m * n));
    with_scratch(k * Panels::width(by, n), |values| {
        fill(by, k, n, values, |row, column| b[row * n + column]);
        let panels = PanelsRef { depth: k, columns: n, instructions: by, values };
        let rows = Rows { values: a, stride: k, count: m };
        multiply_panels(rows, panels, Target { values: out, stride: n, add, bias: &[] });
    });
}

#[cfg(test)]
mod tests;
