//! Convolutions of three cells a side, by Winograd's algorithm: several outputs from fewer products.
//!
//! Tiles are transformed, multiplied by the filters, frequency by frequency, and transformed back. If the filters fit a
//! core's cache, each thread does all three for a few tiles at a time, and nothing of it leaves the cache. Otherwise
//! all tiles are transformed first, and threads share out the frequencies, so that each filter is read once.

use super::memory::{Aligned, with_scratch};
use super::product::{ACROSS, Panels, PanelsRef, Rows, Target, multiply_panels};
use super::tiles::{Backward, CELLS, Forward, Grid, Shared, Spread};
use super::transform::{Four, One, Two, filter_rows};
use super::vector::Instructions;
use crate::dispatch::for_each_instruction_set;
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Floats that a thread works on at a time: half of a core's cache of 2 MB.
const AT_ONCE: usize = 1 << 18;

pub(super) struct Winograd {
    instructions: Instructions,
    inputs: usize,
    outputs: usize,
    /// Cells of the output in a tile, along each axis.
    tile: [usize; 3],
    frequencies: usize,
    /// Panels, one frequency after the other.
    filters: Aligned,
    /// Made up to whole vectors.
    bias: Aligned,
    /// What a tile reads outside the grid.
    zeros: Aligned,
}

/// Calls a task of three axes for the tiles that it is compiled for.
macro_rules! for_tiles {
    ($self:ident, $task:ident { $($fields:tt)* }) => {
        match $self.tile {
            [4, 4, 4] => $self.instructions.run($task::<Four, Four, Four> { $($fields)*, axes: PhantomData }),
            [2, 2, 2] => $self.instructions.run($task::<Two, Two, Two> { $($fields)*, axes: PhantomData }),
            [4, 4, 1] => $self.instructions.run($task::<Four, Four, One> { $($fields)*, axes: PhantomData }),
            [2, 2, 1] => $self.instructions.run($task::<Two, Two, One> { $($fields)*, axes: PhantomData }),
            other => unreachable!("tiles of {other:?}"),
        }
    };
}

pub(super) use for_tiles;

/// Floats of a few grids whose tiles are transformed together: a part of the cache that cores share.
pub(super) const TOGETHER: usize = 1 << 22;

/// Calls `transform` with each of `samples` grids and shares of its tiles, on several threads.
pub(super) fn share_out(samples: usize, tiles: usize, transform: impl Fn(usize, Range<usize>) + Sync) {
    let shares = (4 * rayon::current_num_threads()).div_ceil(samples).min(tiles);
    (0..samples * shares).into_par_iter().for_each(|nth| {
        let (sample, share) = (nth / shares, nth % shares);
        transform(sample, tiles * share / shares..tiles * (share + 1) / shares);
    });
}

impl Winograd {
    /// Large tiles spare products and need large filters: those of 192 x 192 channels take 9 MB in tiles of two, and 32
    /// in tiles of four. Where there are so many channels grids have few cells, and it takes longer to read them.
    pub fn tile(inputs: usize, outputs: usize, axes: usize) -> [usize; 3] {
        match (axes, inputs * outputs) {
            (2, ..=40_000) => [4, 4, 1],
            (2, _) => [2, 2, 1],
            (_, ..=20_000) => [4, 4, 4],
            (_, _) => [2, 2, 2],
        }
    }

    /// `weight`: outputs x inputs x taps, nine or 27.
    pub fn new(
        instructions: Instructions,
        weight: &[f32],
        bias: &[f32],
        inputs: usize,
        outputs: usize,
        tile: [usize; 3],
    ) -> Self {
        let frequencies = tile.iter().map(|&t| filter_rows(t).len()).product();
        let width = Panels::width(instructions, outputs);
        let mut filters = Aligned::zeros(frequencies * inputs * width);
        transform_filters(
            weight,
            tile,
            [inputs, outputs, width],
            ACROSS * instructions.lanes(),
            &mut filters,
        );
        let mut wide_bias = Aligned::zeros(width);
        wide_bias[..bias.len()].copy_from_slice(bias);
        Self {
            instructions,
            inputs,
            outputs,
            tile,
            frequencies,
            filters,
            bias: wide_bias,
            zeros: Aligned::zeros(inputs),
        }
    }

    /// Convolves `samples` grids of the same size, one after the other in memory.
    pub fn apply(
        &self,
        samples: usize,
        input: &[f32],
        size: [usize; 3],
        rectify: bool,
        add: bool,
        out: &mut [f32],
    ) {
        let grid = Grid::new(size, self.tile);
        let [read, written] = [input.len() / samples, out.len() / samples];
        let (wide_in, wide_out) = self.widths();
        if self.filters.len() > (1 << 19) || samples * grid.tiles[0] < rayon::current_num_threads() {
            let each = self.frequencies * (wide_in + wide_out) * grid.tiles.iter().product::<usize>();
            let at_once = (TOGETHER / each).clamp(1, samples);
            for (input, out) in input.chunks(at_once * read).zip(out.chunks_mut(at_once * written)) {
                self.by_frequency(grid, out.len() / written, input, rectify, add, out);
            }
        } else {
            let samples = out.par_chunks_mut(written).zip(input.par_chunks(read));
            samples.for_each(|(out, input)| self.by_layers(grid, input, rectify, add, out));
        }
    }

    fn by_layers(&self, grid: Grid, input: &[f32], rectify: bool, add: bool, out: &mut [f32]) {
        let (wide_in, wide_out) = self.widths();
        let at_once = (AT_ONCE / (self.frequencies * (wide_in + wide_out))).max(1);
        let in_layer = self.tile[0] * grid.size[1] * grid.size[2] * self.outputs;
        let threads = rayon::current_num_threads();
        // A few layers of tiles for each task, about as many tiles as are worked on at a time.
        let layers = at_once.div_ceil(grid.in_layer()).min(grid.tiles[0].div_ceil(threads)).max(1);
        out.par_chunks_mut(layers * in_layer).enumerate().for_each(|(nth, out)| {
            let layer = nth * layers;
            let end = (layer + layers).min(grid.tiles[0]);
            let tiles = layer * grid.in_layer()..end * grid.in_layer();
            let blocks = tiles.len().div_ceil(at_once);
            let longest = tiles.len().div_ceil(blocks);
            let (before, after) = (Spread::new(longest, wide_in), Spread::new(longest, wide_out));
            let split = self.frequencies * before.frequency;
            with_scratch(split + self.frequencies * after.frequency, |scratch| {
                let (values, products) = scratch.split_at_mut(split);
                for block in 0..blocks {
                    let at = |block: usize| tiles.start + tiles.len() * block / blocks;
                    let range = at(block)..at(block + 1);
                    self.forward(
                        grid,
                        input,
                        rectify,
                        range.clone(),
                        range.start,
                        before,
                        Shared::new(values),
                    );
                    for f in 0..self.frequencies {
                        let rows = Rows {
                            values: &values[f * before.frequency..],
                            stride: before.tile,
                            count: range.len(),
                        };
                        let values = &mut products[f * after.frequency..];
                        let target = Target { values, stride: after.tile, add: false, bias: &[] };
                        multiply_panels(rows, self.filter(f), target);
                    }
                    let cells = layer * self.tile[0];
                    self.backward(grid, products, range.start, after, range, add, cells, out);
                }
            });
        });
    }

    fn by_frequency(
        &self,
        grid: Grid,
        samples: usize,
        input: &[f32],
        rectify: bool,
        add: bool,
        out: &mut [f32],
    ) {
        let (wide_in, wide_out) = self.widths();
        let each = grid.in_layer() * grid.tiles[0];
        let tiles = samples * each;
        let [read, written] = [input.len() / samples, out.len() / samples];
        let (before, after) = (Spread::new(tiles, wide_in), Spread::new(tiles, wide_out));
        let split = self.frequencies * before.frequency;
        with_scratch(split + self.frequencies * after.frequency, |scratch| {
            let (values, products) = scratch.split_at_mut(split);
            let shared = Shared::new(values);
            share_out(samples, each, |sample, tiles| {
                let input = &input[sample * read..][..read];
                self.forward(grid, input, rectify, tiles, 0, before, shared.skip(sample * each * wide_in));
            });
            products.par_chunks_exact_mut(after.frequency).enumerate().for_each(|(f, products)| {
                let rows =
                    Rows { values: &values[f * before.frequency..], stride: before.tile, count: tiles };
                let target = Target { values: products, stride: after.tile, add: false, bias: &[] };
                multiply_panels(rows, self.filter(f), target);
            });
            let in_layer = self.tile[0] * grid.size[1] * grid.size[2] * self.outputs;
            out.par_chunks_mut(written).enumerate().for_each(|(sample, out)| {
                let products = &products[sample * each * wide_out..];
                out.par_chunks_mut(in_layer).enumerate().for_each(|(layer, out)| {
                    let tiles = layer * grid.in_layer()..(layer + 1) * grid.in_layer();
                    self.backward(grid, products, 0, after, tiles, add, layer * self.tile[0], out);
                });
            });
        });
    }

    /// Inputs and outputs, made up to whole vectors.
    fn widths(&self) -> (usize, usize) {
        let wide = |channels| Panels::width(self.instructions, channels);
        (wide(self.inputs), wide(self.outputs))
    }

    fn filter(&self, frequency: usize) -> PanelsRef<'_> {
        let columns = self.widths().1;
        let length = self.inputs * columns;
        let values = &self.filters[frequency * length..][..length];
        PanelsRef { depth: self.inputs, columns, instructions: self.instructions, values }
    }

    #[allow(clippy::too_many_arguments)]
    fn forward(
        &self,
        grid: Grid,
        input: &[f32],
        rectify: bool,
        tiles: Range<usize>,
        first: usize,
        spread: Spread,
        out: Shared,
    ) {
        let (channels, zeros) = (self.inputs, &self.zeros[..]);
        for_tiles!(self, Forward { grid, input, channels, rectify, tiles, spread, zeros, first, out });
    }

    #[allow(clippy::too_many_arguments)]
    fn backward(
        &self,
        grid: Grid,
        products: &[f32],
        first: usize,
        spread: Spread,
        tiles: Range<usize>,
        add: bool,
        layer: usize,
        out: &mut [f32],
    ) {
        let (channels, bias) = (self.outputs, &self.bias[..]);
        with_scratch(channels, |waste| {
            for_tiles!(
                self,
                Backward { grid, products, first, spread, tiles, channels, bias, add, layer, out, waste }
            );
        });
    }
}

/// Most columns of a panel.
const WIDEST_PANEL: usize = 32;

for_each_instruction_set! {
/// Makes filters of three taps an axis (along axes with tiles of one cell, of one) into panels, `panel` columns wide at
/// most, frequency by frequency. Columns beyond `outputs` up to `width` are left as they are.
fn transform_filters(
    weight: &[f32],
    tile: [usize; 3],
    [inputs, outputs, width]: [usize; 3],
    panel: usize,
    out: &mut [f32],
) {
    let rows = tile.map(filter_rows);
    let taps: usize = rows.iter().map(|rows| rows[0].len()).product();
    // Filters of one input and the outputs of a panel, side by side.
    let mut values = vec![[0.0; WIDEST_PANEL]; CELLS];
    let mut next = values.clone();
    for first in (0..outputs).step_by(panel) {
        let across = panel.min(width - first);
        let columns = panel.min(outputs - first);
        for input in 0..inputs {
            for column in 0..columns {
                let filter = &weight[((first + column) * inputs + input) * taps..][..taps];
                values.iter_mut().zip(filter).for_each(|(values, &w)| values[column] = f64::from(w));
            }
            // The first axis is transformed and made the last, three times.
            let mut count = taps;
            for rows in rows {
                let rest = count / rows[0].len();
                for (i, row) in rows.iter().enumerate() {
                    for r in 0..rest {
                        let mut sums = [0.0; WIDEST_PANEL];
                        for (tap, factor) in row.iter().enumerate() {
                            let values = &values[tap * rest + r];
                            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
                        }
                        next[r * rows.len() + i] = sums;
                    }
                }
                count = rest * rows.len();
                std::mem::swap(&mut values, &mut next);
            }
            for (frequency, values) in values[..count].iter().enumerate() {
                let start = (frequency * width + first) * inputs + input * across;
                let to = out[start..][..columns].iter_mut();
                to.zip(values).for_each(|(to, &value)| *to = value as f32);
            }
        }
    }
}
}
