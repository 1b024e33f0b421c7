//! Gradients of a convolution of three cells a side.
//!
//! By its input: a convolution of the outputs' gradient by the filter turned around. By its filter: Winograd's algorithm
//! is y = A' [(G g) * (B' x)], so that a tile says G' [(B' x) * (A dy)] of the filter. For each frequency that is one
//! product of matrices, input x tile by tile x output, over the tiles of all samples. Sums are made in the same order
//! whatever the number of threads.

use super::Convolution;
use super::memory::{Aligned, with_scratch};
use super::product::{ACROSS, Panels};
use super::tiles::{CELLS, Forward, Grid, Shared, Spread};
use super::transform::{Four, One, Turned, Two, filter_rows};
use super::vector::{Instructions, Task, Vector};
use super::winograd::{TOGETHER, Winograd, for_tiles, share_out};
use crate::dispatch::for_each_instruction_set;
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// The gradient by the input of `Convolution::three(weight, ...)`, applied to grids of `size`, from that by the output.
/// Where the input was rectified, `rectified` is what it was before.
pub fn input_gradient(
    gradient: &[f32],
    weight: &[f32],
    size: [usize; 3],
    [inputs, outputs]: [usize; 2],
    axes: usize,
    rectified: Option<&[f32]>,
    out: &mut [f32],
) {
    let taps = 3usize.pow(axes as u32);
    assert_eq!(weight.len(), outputs * inputs * taps);
    let mut turned = vec![0.0; weight.len()];
    for (nth, turned) in turned.chunks_exact_mut(taps).enumerate() {
        let (input, output) = (nth / outputs, nth % outputs);
        let filter = &weight[(output * inputs + input) * taps..][..taps];
        turned.iter_mut().zip(filter.iter().rev()).for_each(|(to, &from)| *to = from);
    }
    let each = size.iter().product::<usize>() * outputs;
    let samples = gradient.len() / each.max(1);
    Convolution::three(&turned, &[], outputs, inputs, axes)
        .apply_to_all(samples, gradient, size, false, false, out);
    if let Some(rectified) = rectified {
        assert_eq!(rectified.len(), out.len());
        out.par_chunks_mut(1 << 15).zip(rectified.par_chunks(1 << 15)).for_each(|(out, was)| {
            out.iter_mut().zip(was).for_each(|(out, &was)| *out = if was <= 0.0 { 0.0 } else { *out });
        });
    }
}

/// The gradient by the weight of `Convolution::three(weight, ...)`, summed over grids of `size`, from their inputs and
/// the gradient by their outputs; `rectify` as in `Convolution::apply`. `out` is outputs x inputs x 3 x 3 (x 3).
pub fn filter_gradient(
    input: &[f32],
    gradient: &[f32],
    size: [usize; 3],
    channels: [usize; 2],
    axes: usize,
    rectify: bool,
    out: &mut [f32],
) {
    FilterGradient::new(Instructions::best(), channels, axes).apply(input, gradient, size, rectify, out);
}

struct FilterGradient {
    instructions: Instructions,
    inputs: usize,
    outputs: usize,
    /// Cells of the output in a tile, along each axis.
    tile: [usize; 3],
    frequencies: usize,
    /// What a tile reads outside the grid.
    zeros: Aligned,
}

impl FilterGradient {
    fn new(instructions: Instructions, [inputs, outputs]: [usize; 2], axes: usize) -> Self {
        assert!(inputs > 0 && outputs > 0 && (axes == 2 || axes == 3));
        let tile = Winograd::tile(inputs, outputs, axes);
        let frequencies = tile.iter().map(|&t| filter_rows(t).len()).product();
        Self { instructions, inputs, outputs, tile, frequencies, zeros: Aligned::zeros(inputs.max(outputs)) }
    }

    fn apply(&self, input: &[f32], gradient: &[f32], size: [usize; 3], rectify: bool, out: &mut [f32]) {
        let Self { inputs, outputs, frequencies, .. } = *self;
        let taps: usize = self.tile.iter().map(|&t| filter_rows(t)[0].len()).product();
        assert_eq!(out.len(), inputs * outputs * taps);
        let cells = size.iter().product::<usize>();
        if cells == 0 || input.is_empty() {
            return out.fill(0.0);
        }
        let samples = input.len() / (cells * inputs);
        assert_eq!((input.len(), gradient.len()), (samples * cells * inputs, samples * cells * outputs));
        let grid = Grid::new(size, self.tile);
        let (wide_in, wide_out) = self.widths();
        let each = frequencies * (wide_in + wide_out) * grid.tiles.iter().product::<usize>();
        let at_once = (TOGETHER / each).clamp(1, samples) * cells;
        with_scratch(frequencies * inputs * wide_out, |sums| {
            let parts = input.chunks(at_once * inputs).zip(gradient.chunks(at_once * outputs));
            for (nth, (input, gradient)) in parts.enumerate() {
                self.accumulate(grid, input, gradient, rectify, nth > 0, sums);
            }
            out.par_chunks_mut(LANES * inputs * taps).enumerate().for_each(|(nth, out)| {
                to_taps(sums, self.tile, [inputs, wide_out], nth * LANES, out);
            });
        });
    }

    /// Inputs and outputs, made up to whole vectors.
    fn widths(&self) -> (usize, usize) {
        let wide = |channels| Panels::width(self.instructions, channels);
        (wide(self.inputs), wide(self.outputs))
    }

    /// Adds the products of a few samples to `sums`, or writes them over what was there.
    fn accumulate(
        &self,
        grid: Grid,
        input: &[f32],
        gradient: &[f32],
        rectify: bool,
        add: bool,
        sums: &mut [f32],
    ) {
        let (wide_in, wide_out) = self.widths();
        let cells = grid.size.iter().product::<usize>();
        let samples = input.len() / (cells * self.inputs);
        let each = grid.tiles.iter().product::<usize>();
        let tiles = samples * each;
        let (before, after) = (Spread::new(tiles, wide_in), Spread::new(tiles, wide_out));
        let split = self.frequencies * before.frequency;
        with_scratch(split + self.frequencies * after.frequency, |scratch| {
            let (values, factors) = scratch.split_at_mut(split);
            let shared = [Shared::new(values), Shared::new(factors)];
            share_out(samples, each, |sample, tiles| {
                let of = |channels| sample * cells * channels..(sample + 1) * cells * channels;
                let [there, here] = [of(self.inputs), of(self.outputs)];
                let to = shared[0].skip(sample * each * wide_in);
                self.forward(grid, &input[there], rectify, tiles.clone(), before, to);
                let to = shared[1].skip(sample * each * wide_out);
                self.turned(grid, &gradient[here], tiles, after, to);
            });
            sums.par_chunks_exact_mut(self.inputs * wide_out).enumerate().for_each(|(f, sums)| {
                self.instructions.run(Correlate {
                    rows: &values[f * before.frequency..][..tiles * wide_in],
                    columns: &factors[f * after.frequency..][..tiles * wide_out],
                    widths: [wide_in, wide_out],
                    tiles,
                    add,
                    sums,
                });
            });
        });
    }

    fn forward(
        &self,
        grid: Grid,
        input: &[f32],
        rectify: bool,
        tiles: Range<usize>,
        spread: Spread,
        out: Shared,
    ) {
        let (channels, zeros, first) = (self.inputs, &self.zeros[..], 0);
        for_tiles!(self, Forward { grid, input, channels, rectify, tiles, spread, zeros, first, out });
    }

    /// Transforms gradients of outputs by the transpose of the way back.
    fn turned(&self, grid: Grid, gradient: &[f32], tiles: Range<usize>, spread: Spread, out: Shared) {
        let (channels, input, zeros, first, rectify) = (self.outputs, gradient, &self.zeros[..], 0, false);
        for_tiles!(self, TurnedForward { grid, input, channels, rectify, tiles, spread, zeros, first, out });
    }
}

type TurnedForward<'a, A, B, C> = Forward<'a, Turned<A>, Turned<B>, Turned<C>>;

/// Tiles of a product that are summed at a time, so that their columns stay in the nearest cache.
const DEPTH: usize = 256;

/// The sum over tiles of the products of each row by each column.
struct Correlate<'a> {
    /// Tile by tile.
    rows: &'a [f32],
    /// Tile by tile.
    columns: &'a [f32],
    /// From tile to tile: whole vectors.
    widths: [usize; 2],
    tiles: usize,
    /// Whether the sums are added to what is there.
    add: bool,
    /// Some of the rows by all of the columns.
    sums: &'a mut [f32],
}

impl Task for Correlate<'_> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { rows, columns, widths: [wide_in, wide_out], tiles, add, sums } = self;
        let count = sums.len() / wide_out;
        assert!(count <= wide_in && wide_out.is_multiple_of(V::LANES));
        assert!(rows.len() >= tiles * wide_in && columns.len() >= tiles * wide_out);
        let blocks = count.div_ceil(V::ROWS);
        for start in (0..tiles).step_by(DEPTH) {
            let depth = (tiles - start).min(DEPTH);
            for first in (0..wide_out).step_by(ACROSS * V::LANES) {
                let whole = wide_out - first >= ACROSS * V::LANES;
                let mut row = 0;
                for block in 0..blocks {
                    let end = count * (block + 1) / blocks;
                    let part = Part {
                        rows: &rows[start * wide_in + row..],
                        columns: &columns[start * wide_out + first..],
                        widths: self.widths,
                        depth,
                        add: add || start > 0,
                    };
                    let sums = &mut sums[row * wide_out + first..];
                    macro_rules! by_count {
                        ($($count:literal)*) => {
                            match end - row {
                                // SAFETY: the instructions are there, as the caller says. Rows and columns have
                                // `depth` tiles from `start` on, sums rows up to `end`.
                                $($count if $count <= V::ROWS => unsafe {
                                    if whole {
                                        part.sum::<V, $count, ACROSS>(sums);
                                    } else {
                                        part.sum::<V, $count, 1>(sums);
                                    }
                                },)*
                                _ => unreachable!("blocks have 1 to V::ROWS rows"),
                            }
                        };
                    }
                    by_count!(1 2 3 4 5 6 7 8 9 10 11 12 13 14);
                    row = end;
                }
            }
        }
    }
}

/// What a block of sums is made of.
struct Part<'a> {
    rows: &'a [f32],
    columns: &'a [f32],
    widths: [usize; 2],
    depth: usize,
    add: bool,
}

impl Part<'_> {
    /// Sums of `R` rows by `C` vectors of columns, which stay in registers.
    #[inline(always)]
    unsafe fn sum<V: Vector, const R: usize, const C: usize>(&self, out: &mut [f32]) {
        let [wide_in, wide_out] = self.widths;
        debug_assert!(out.len() >= (R - 1) * wide_out + C * V::LANES);
        // SAFETY: the caller's.
        unsafe {
            let mut sums = [[V::splat(0.0); C]; R];
            let (mut row, mut column) = (self.rows.as_ptr(), self.columns.as_ptr());
            for _ in 0..self.depth {
                let mut b = [V::splat(0.0); C];
                for (c, b) in b.iter_mut().enumerate() {
                    *b = V::load(column.add(c * V::LANES));
                }
                for (r, sums) in sums.iter_mut().enumerate() {
                    let factor = V::splat(*row.add(r));
                    for (sum, b) in sums.iter_mut().zip(b) {
                        *sum = factor.times_plus(b, *sum);
                    }
                }
                (row, column) = (row.wrapping_add(wide_in), column.wrapping_add(wide_out));
            }
            for (r, sums) in sums.into_iter().enumerate() {
                for (c, sum) in sums.into_iter().enumerate() {
                    let to = out.as_mut_ptr().add(r * wide_out + c * V::LANES);
                    let sum = if self.add { V::load(to).plus(sum) } else { sum };
                    sum.store(to);
                }
            }
        }
    }
}

/// Outputs whose filters are made side by side.
const LANES: usize = 16;

for_each_instruction_set! {
/// Makes `sums`, frequency x input x output (`wide` of them), into the taps of the filters of a few outputs, from
/// `first` on.
fn to_taps(sums: &[f32], tile: [usize; 3], [inputs, wide]: [usize; 2], first: usize, out: &mut [f32]) {
    let rows = tile.map(filter_rows);
    let taps: usize = rows.iter().map(|rows| rows[0].len()).product();
    let frequencies: usize = rows.iter().map(|rows| rows.len()).product();
    let columns = out.len() / (inputs * taps);
    let mut values = vec![[0f32; LANES]; CELLS];
    let mut next = values.clone();
    for input in 0..inputs {
        for (f, values) in values[..frequencies].iter_mut().enumerate() {
            let from = &sums[(f * inputs + input) * wide + first..][..columns];
            values[..columns].copy_from_slice(from);
        }
        // The first axis is transformed and made the last, three times.
        let mut count = frequencies;
        for rows in rows {
            let (rest, taps) = (count / rows.len(), rows[0].len());
            for tap in 0..taps {
                for r in 0..rest {
                    let mut sums = [0f32; LANES];
                    for (i, row) in rows.iter().enumerate() {
                        let (factor, values) = (row[tap] as f32, &values[i * rest + r]);
                        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
                    }
                    next[r * taps + tap] = sums;
                }
            }
            count = rest * taps;
            std::mem::swap(&mut values, &mut next);
        }
        for column in 0..columns {
            let to = &mut out[(column * inputs + input) * taps..][..taps];
            to.iter_mut().zip(&values).for_each(|(to, values)| *to = values[column]);
        }
    }
}
}

#[cfg(test)]
mod tests;
