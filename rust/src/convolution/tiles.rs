//! Tiles of a grid on their way to the frequencies, and back.
//!
//! A *frequency* is one of the products that a tile is made of. Numbers of frequencies lie as `frequency x tile x
//! channel`, so that for each the tiles are the rows of a matrix.

// Loops have fixed lengths, and go over several arrays.
#![allow(clippy::needless_range_loop)]

use super::transform::{Axis, WIDEST};
use super::vector::{Task, Vector};
use std::marker::PhantomData;
use std::ops::Range;

/// A grid in tiles.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    /// Cells along each axis.
    pub size: [usize; 3],
    /// Tiles along each axis.
    pub tiles: [usize; 3],
}

impl Grid {
    pub fn new(size: [usize; 3], tile: [usize; 3]) -> Self {
        Self { size, tiles: std::array::from_fn(|a| size[a].div_ceil(tile[a])) }
    }

    /// Tiles in a layer across the first axis.
    pub fn in_layer(&self) -> usize {
        self.tiles[1] * self.tiles[2]
    }

    #[inline(always)]
    fn place(&self, tile: usize) -> [usize; 3] {
        let line = tile / self.tiles[2];
        [line / self.tiles[1], line % self.tiles[1], tile % self.tiles[2]]
    }
}

/// Where numbers of frequencies lie.
#[derive(Clone, Copy)]
pub(super) struct Spread {
    /// From frequency to frequency.
    pub frequency: usize,
    /// From tile to tile: channels, made up to whole vectors.
    pub tile: usize,
}

impl Spread {
    /// Of so many tiles. Frequencies are a cache line further apart than they need to be: at powers of two they would
    /// all want the same places of the cache.
    pub fn new(tiles: usize, channels: usize) -> Self {
        Self { frequency: tiles * channels + 16, tile: channels }
    }
}

/// The cells of a tile that reaches from `first`, whose places wrap around below zero: where those within `rows` lie in
/// `cells`, and `outside` for all others.
///
/// # Safety
///
/// `cells` points to `rows` of the grid, with `channels` each.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
unsafe fn locate<const N: usize>(
    grid: Grid,
    wide: [usize; 3],
    first: [usize; 3],
    rows: Range<usize>,
    cells: *mut f32,
    channels: usize,
    outside: *mut f32,
    places: &mut [*mut f32; N],
) {
    let [_, cols, depths] = grid.size;
    let mut n = 0;
    for a in 0..wide[0] {
        let row = first[0].wrapping_add(a);
        for b in 0..wide[1] {
            let col = first[1].wrapping_add(b);
            let there = rows.contains(&row) && col < cols;
            for c in 0..wide[2] {
                let depth = first[2].wrapping_add(c);
                let cell = row.wrapping_sub(rows.start).wrapping_mul(cols).wrapping_add(col);
                let cell = cell.wrapping_mul(depths).wrapping_add(depth).wrapping_mul(channels);
                places[n] = if there && depth < depths { cells.wrapping_add(cell) } else { outside };
                n += 1;
            }
        }
    }
}

/// The most cells of a tile.
pub(super) const CELLS: usize = WIDEST * WIDEST * WIDEST;
/// The most cells of a tile across the first axis.
const ACROSS: usize = WIDEST * WIDEST;

/// Floats that several threads write to, each for tiles of its own.
#[derive(Clone, Copy)]
pub(super) struct Shared<'a> {
    start: *mut f32,
    length: usize,
    life: PhantomData<&'a mut [f32]>,
}

// SAFETY: what threads do with it is write to places that no other thread writes to or reads.
unsafe impl Send for Shared<'_> {}
// SAFETY: as above.
unsafe impl Sync for Shared<'_> {}

impl<'a> Shared<'a> {
    pub fn new(floats: &'a mut [f32]) -> Self {
        Self { start: floats.as_mut_ptr(), length: floats.len(), life: PhantomData }
    }

    /// All but the first floats.
    pub fn skip(self, floats: usize) -> Self {
        assert!(floats <= self.length);
        Self { start: self.start.wrapping_add(floats), length: self.length - floats, ..self }
    }
}

/// Transforms tiles of the input. No other thread may have any of these tiles.
pub(super) struct Forward<'a, A, B, C> {
    pub grid: Grid,
    pub input: &'a [f32],
    pub channels: usize,
    pub rectify: bool,
    pub tiles: Range<usize>,
    pub spread: Spread,
    /// As many as there are channels.
    pub zeros: &'a [f32],
    /// The first tile of `out`.
    pub first: usize,
    pub out: Shared<'a>,
    pub axes: PhantomData<(A, B, C)>,
}

impl<A: Axis, B: Axis, C: Axis> Task for Forward<'_, A, B, C> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { grid, input, channels, spread, zeros, .. } = self;
        let across = B::WIDE * C::WIDE;
        let vectors = channels.next_multiple_of(V::LANES);
        assert!(input.len() == grid.size.iter().product::<usize>() * channels && spread.tile >= vectors);
        let room = (self.tiles.end - self.first) * spread.tile;
        assert!(self.first <= self.tiles.start && room <= spread.frequency);
        assert!(self.out.length >= (A::WIDE * across - 1) * spread.frequency + room);
        assert!(zeros.len() >= channels);
        // Tiles of one cell have no margin.
        let [tile, wide] = [[A::TILE, B::TILE, C::TILE], [A::WIDE, B::WIDE, C::WIDE]];
        let mut places = [std::ptr::null_mut(); CELLS];
        // SAFETY: the instructions are there, as the caller says. What is read is in the grid, whose length was
        // compared, or among the zeros; the last number written is in `out`.
        unsafe {
            let floor = V::splat(if self.rectify { 0.0 } else { f32::NEG_INFINITY });
            let mut layers = [[V::splat(0.0); ACROSS]; WIDEST];
            for number in self.tiles {
                let at = grid.place(number);
                let mut first = [0; 3];
                for a in 0..3 {
                    first[a] = (at[a] * tile[a]).wrapping_sub(usize::from(tile[a] > 1));
                }
                let (cells, outside) = (input.as_ptr().cast_mut(), zeros.as_ptr().cast_mut());
                locate(grid, wide, first, 0..grid.size[0], cells, channels, outside, &mut places);
                for channel in (0..channels).step_by(V::LANES) {
                    let left = channels - channel;
                    for (a, layer) in layers.iter_mut().take(A::WIDE).enumerate() {
                        let places = &places[a * across..][..across];
                        if left >= V::LANES {
                            forward_layer::<V, B, C, true>(places, channel, left, floor, layer);
                        } else {
                            forward_layer::<V, B, C, false>(places, channel, left, floor, layer);
                        }
                    }
                    let mut out = self.out.start.add((number - self.first) * spread.tile + channel);
                    for place in 0..across {
                        let mut line = [V::splat(0.0); WIDEST];
                        for a in 0..A::WIDE {
                            line[a] = layers[a][place];
                        }
                        A::forward(&mut line);
                        for a in 0..A::WIDE {
                            line[a].store(out.add(a * across * spread.frequency));
                        }
                        out = out.wrapping_add(spread.frequency);
                    }
                }
            }
        }
    }
}

/// Transforms what lies across the first axis along the others.
#[inline(always)]
unsafe fn forward_layer<V: Vector, B: Axis, C: Axis, const WHOLE: bool>(
    places: &[*mut f32],
    channel: usize,
    left: usize,
    floor: V,
    layer: &mut [V; ACROSS],
) {
    // SAFETY: the caller's.
    unsafe {
        let mut slab = [[V::splat(0.0); WIDEST]; WIDEST];
        for b in 0..B::WIDE {
            for c in 0..C::WIDE {
                let from = places[b * C::WIDE + c].add(channel);
                let value = if WHOLE { V::load(from) } else { load(from, left) };
                slab[b][c] = value.at_least(floor);
            }
            C::forward(&mut slab[b]);
        }
        for c in 0..C::WIDE {
            let mut line = [V::splat(0.0); WIDEST];
            for b in 0..B::WIDE {
                line[b] = slab[b][c];
            }
            B::forward(&mut line);
            for b in 0..B::WIDE {
                layer[b * C::WIDE + c] = line[b];
            }
        }
    }
}

/// Makes the products of all frequencies into tiles of the output.
pub(super) struct Backward<'a, A, B, C> {
    pub grid: Grid,
    pub products: &'a [f32],
    /// The first tile of `products`.
    pub first: usize,
    pub spread: Spread,
    /// The tiles to make.
    pub tiles: Range<usize>,
    pub channels: usize,
    /// Made up to whole vectors.
    pub bias: &'a [f32],
    pub add: bool,
    /// The first layer of cells that `out` has.
    pub layer: usize,
    pub out: &'a mut [f32],
    /// As many as there are channels, for what lies outside the grid.
    pub waste: &'a mut [f32],
    pub axes: PhantomData<(A, B, C)>,
}

impl<A: Axis, B: Axis, C: Axis> Task for Backward<'_, A, B, C> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { grid, products, spread, channels, bias, .. } = self;
        let across = B::WIDE * C::WIDE;
        let vectors = channels.next_multiple_of(V::LANES);
        assert!(spread.tile >= vectors && bias.len() >= vectors && self.first <= self.tiles.start);
        let last = (A::WIDE * across - 1) * spread.frequency + (self.tiles.end - self.first) * spread.tile;
        assert!(products.len() >= last && self.waste.len() >= channels);
        let rows = self.layer..self.layer + self.out.len() / (grid.size[1] * grid.size[2] * channels);
        let tile = [A::TILE, B::TILE, C::TILE];
        let mut places = [std::ptr::null_mut(); CELLS];
        // SAFETY: the instructions are there, as the caller says. The last product that is read is there; what is
        // written is among the rows that `out` has, or goes to waste.
        unsafe {
            let mut layers = [[V::splat(0.0); ACROSS]; WIDEST];
            let (cells, outside) = (self.out.as_mut_ptr(), self.waste.as_mut_ptr());
            for at in self.tiles {
                let from = products.as_ptr().add((at - self.first) * spread.tile);
                let at = grid.place(at);
                let first = [at[0] * tile[0], at[1] * tile[1], at[2] * tile[2]];
                locate(grid, tile, first, rows.clone(), cells, channels, outside, &mut places);
                for channel in (0..channels).step_by(V::LANES) {
                    let left = channels - channel;
                    let bias = V::load(bias.as_ptr().add(channel));
                    let mut from = from.add(channel);
                    for place in 0..across {
                        let mut line = [V::splat(0.0); WIDEST];
                        for a in 0..A::WIDE {
                            line[a] = V::load(from.add(a * across * spread.frequency));
                        }
                        A::backward(&mut line);
                        for a in 0..A::TILE {
                            layers[a][place] = line[a];
                        }
                        from = from.wrapping_add(spread.frequency);
                    }
                    for (a, layer) in layers.iter().take(A::TILE).enumerate() {
                        let places = &places[a * B::TILE * C::TILE..][..B::TILE * C::TILE];
                        match (self.add, left >= V::LANES) {
                            (false, true) => {
                                backward_layer::<V, B, C, false, true>(layer, bias, channel, left, places);
                            }
                            (true, true) => {
                                backward_layer::<V, B, C, true, true>(layer, bias, channel, left, places);
                            }
                            (false, false) => {
                                backward_layer::<V, B, C, false, false>(layer, bias, channel, left, places);
                            }
                            (true, false) => {
                                backward_layer::<V, B, C, true, false>(layer, bias, channel, left, places);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Makes what lies across the first axis into cells along the others.
#[inline(always)]
unsafe fn backward_layer<V: Vector, B: Axis, C: Axis, const ADD: bool, const WHOLE: bool>(
    layer: &[V; ACROSS],
    bias: V,
    channel: usize,
    left: usize,
    places: &[*mut f32],
) {
    // SAFETY: the caller's.
    unsafe {
        let mut slab = [[V::splat(0.0); WIDEST]; WIDEST];
        for c in 0..C::WIDE {
            let mut line = [V::splat(0.0); WIDEST];
            for b in 0..B::WIDE {
                line[b] = layer[b * C::WIDE + c];
            }
            B::backward(&mut line);
            for b in 0..B::TILE {
                slab[b][c] = line[b];
            }
        }
        for b in 0..B::TILE {
            C::backward(&mut slab[b]);
            for c in 0..C::TILE {
                let to = places[b * C::TILE + c].add(channel);
                let mut sum = slab[b][c].plus(bias);
                if ADD {
                    sum = sum.plus(if WHOLE { V::load(to) } else { load(to, left) });
                }
                if WHOLE {
                    sum.store(to);
                } else {
                    store(sum, to, left);
                }
            }
        }
    }
}

/// The first `left` floats of a vector, and zeros.
#[inline(always)]
unsafe fn load<V: Vector>(from: *const f32, left: usize) -> V {
    // SAFETY: the caller has `left` floats, or a whole vector.
    unsafe {
        if left >= V::LANES {
            return V::load(from);
        }
        let mut buffer = [0.0; 16];
        std::ptr::copy_nonoverlapping(from, buffer.as_mut_ptr(), left);
        V::load(buffer.as_ptr())
    }
}

/// Writes the first `left` floats of a vector.
#[inline(always)]
unsafe fn store<V: Vector>(value: V, to: *mut f32, left: usize) {
    // SAFETY: the caller has room for `left` floats, or a whole vector.
    unsafe {
        if left >= V::LANES {
            return value.store(to);
        }
        let mut buffer = [0.0; 16];
        value.store(buffer.as_mut_ptr());
        std::ptr::copy_nonoverlapping(buffer.as_ptr(), to, left);
    }
}
