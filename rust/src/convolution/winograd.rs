//! Convolutions of three cells a side, by Winograd's algorithm: several outputs from fewer products.
//!
//! Tiles are transformed, multiplied by the filters, frequency by frequency, and transformed back. If the filters fit a
//! core's cache, each thread does all three for a few tiles at a time, and nothing of it leaves the cache. Otherwise
//! all tiles are transformed first, and threads share out the frequencies, so that each filter is read once.

use super::memory::{Aligned, with_scratch};
use super::product::{Panels, PanelsRef, Rows, Target, fill, multiply_panels};
use super::tiles::{Backward, Forward, Grid, Shared, Spread};
use super::transform::{Four, One, Two, filter_rows};
use super::vector::Instructions;
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
            [4, 4, 2] => $self.instructions.run($task::<Four, Four, Two> { $($fields)*, axes: PhantomData }),
            [4, 4, 4] => $self.instructions.run($task::<Four, Four, Four> { $($fields)*, axes: PhantomData }),
            [2, 2, 2] => $self.instructions.run($task::<Two, Two, Two> { $($fields)*, axes: PhantomData }),
            [4, 4, 1] => $self.instructions.run($task::<Four, Four, One> { $($fields)*, axes: PhantomData }),
            [2, 2, 1] => $self.instructions.run($task::<Two, Two, One> { $($fields)*, axes: PhantomData }),
            other => unreachable!("tiles of {other:?}"),
        }
    };
}

impl Winograd {
    /// Large tiles spare more products and need larger filters: where there are many channels, grids have few cells,
    /// and reading the filters would take longer than the products.
    pub fn tile(inputs: usize, outputs: usize, axes: usize) -> [usize; 3] {
        match (axes, inputs * outputs <= 128 * 128) {
            (2, true) => [4, 4, 1],
            (2, false) => [2, 2, 1],
            (_, true) => [4, 4, 4],
            (_, false) => [2, 2, 2],
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
        let transformed = transform_filters(weight, tile);
        let frequencies = tile.iter().map(|&t| filter_rows(t).len()).product();
        let width = Panels::width(instructions, outputs);
        let mut filters = Aligned::zeros(frequencies * inputs * width);
        if inputs * width > 0 {
            for (f, panels) in filters.chunks_exact_mut(inputs * width).enumerate() {
                let filter = &transformed[f * inputs * outputs..][..inputs * outputs];
                // Columns that fill up vectors are computed as well: they have a place among the products.
                fill(instructions, inputs, width, panels, |i, o| {
                    if o < outputs { filter[o * inputs + i] } else { 0.0 }
                });
            }
        }
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

    pub fn apply(&self, input: &[f32], size: [usize; 3], rectify: bool, add: bool, out: &mut [f32]) {
        let grid = Grid::new(size, self.tile);
        let (wide_in, wide_out) = self.widths();
        let at_once = (AT_ONCE / (self.frequencies * (wide_in + wide_out))).max(1);
        let in_layer = self.tile[0] * size[1] * size[2] * self.outputs;
        let threads = rayon::current_num_threads();
        if self.filters.len() > (1 << 19) || grid.tiles[0] < threads {
            return self.by_frequency(grid, input, rectify, add, out);
        }
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

    fn by_frequency(&self, grid: Grid, input: &[f32], rectify: bool, add: bool, out: &mut [f32]) {
        let (wide_in, wide_out) = self.widths();
        let (each, tiles) = (grid.in_layer(), grid.in_layer() * grid.tiles[0]);
        let (before, after) = (Spread::new(tiles, wide_in), Spread::new(tiles, wide_out));
        let split = self.frequencies * before.frequency;
        with_scratch(split + self.frequencies * after.frequency, |scratch| {
            let (values, products) = scratch.split_at_mut(split);
            let shared = Shared::new(values);
            let share = tiles.div_ceil(4 * rayon::current_num_threads());
            (0..tiles.div_ceil(share)).into_par_iter().for_each(|nth| {
                let tiles = nth * share..((nth + 1) * share).min(tiles);
                self.forward(grid, input, rectify, tiles, 0, before, shared);
            });
            products.par_chunks_exact_mut(after.frequency).enumerate().for_each(|(f, products)| {
                let rows =
                    Rows { values: &values[f * before.frequency..], stride: before.tile, count: tiles };
                let target = Target { values: products, stride: after.tile, add: false, bias: &[] };
                multiply_panels(rows, self.filter(f), target);
            });
            let in_layer = self.tile[0] * grid.size[1] * grid.size[2] * self.outputs;
            out.par_chunks_mut(in_layer).enumerate().for_each(|(layer, out)| {
                let tiles = layer * each..(layer + 1) * each;
                self.backward(grid, products, 0, after, tiles, add, layer * self.tile[0], out);
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

/// Filters of three taps an axis as frequencies: frequency x filter. Of an axis of tiles of one cell, they have one tap.
fn transform_filters(weight: &[f32], tile: [usize; 3]) -> Vec<f32> {
    let [a, b, c] = tile.map(filter_rows);
    let taps = [a, b, c].map(|rows| rows[0].len());
    let filters = weight.len() / taps.iter().product::<usize>();
    let mut out = vec![0.0; a.len() * b.len() * c.len() * filters];
    for (f, filter) in weight.chunks_exact(taps.iter().product()).enumerate() {
        let mut values: Vec<f64> = filter.iter().map(|&w| f64::from(w)).collect();
        // The first axis is transformed and made the last, three times.
        for rows in [a, b, c] {
            let rest = values.len() / rows[0].len();
            let mut next = vec![0.0; rest * rows.len()];
            for (i, row) in rows.iter().enumerate() {
                for r in 0..rest {
                    next[r * rows.len() + i] =
                        row.iter().enumerate().map(|(tap, factor)| factor * values[tap * rest + r]).sum();
                }
            }
            values = next;
        }
        for (frequency, value) in values.into_iter().enumerate() {
            out[frequency * filters + f] = value as f32;
        }
    }
    out
}
