//! Tiles of a grid on their way to the frequencies, and back.
//!
//! A *frequency* is one of the products that a tile is made of. Numbers of frequencies lie as `frequency x tile x
//! channel`, so that for each the tiles are the rows of a matrix.

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

/// Transforms tiles of the input.
pub(super) struct Forward<'a, A, B, C> {
    pub grid: Grid,
    pub input: &'a [f32],
    pub channels: usize,
    pub rectify: bool,
    pub tiles: Range<usize>,
    pub spread: Spread,
    pub out: &'a mut [f32],
    pub axes: PhantomData<(A, B, C)>,
}

impl<A: Axis, B: Axis, C: Axis> Task for Forward<'_, A, B, C> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { grid, input, channels, spread, .. } = self;
        let [rows, cols, depths] = grid.size;
        let across = B::WIDE * C::WIDE;
        let vectors = channels.next_multiple_of(V::LANES);
        assert!(input.len() == rows * cols * depths * channels && spread.tile >= vectors);
        let last = (A::WIDE * across - 1) * spread.frequency + self.tiles.len() * spread.tile;
        assert!(self.out.len() >= last && self.tiles.len() * spread.tile <= spread.frequency);
        let kernel = |tile: usize, wide: usize| usize::from(wide > tile);
        let margin = [kernel(A::TILE, A::WIDE), kernel(B::TILE, B::WIDE), kernel(C::TILE, C::WIDE)];
        // SAFETY: the instructions are there, as the caller says. What is read is in the grid, whose length was
        // compared, and has all channels of the vector or goes through a buffer; the last number written is in `out`.
        unsafe {
            let zero = V::splat(0.0);
            let floor = V::splat(if self.rectify { 0.0 } else { f32::NEG_INFINITY });
            let mut layers = [[zero; WIDEST * WIDEST]; WIDEST];
            for (nth, tile) in self.tiles.enumerate() {
                let [i, j, k] = grid.place(tile);
                // Beyond the first cell they wrap around to large numbers.
                let row = (i * A::TILE).wrapping_sub(margin[0]);
                let col = (j * B::TILE).wrapping_sub(margin[1]);
                let depth = (k * C::TILE).wrapping_sub(margin[2]);
                for channel in (0..channels).step_by(V::LANES) {
                    let left = channels - channel;
                    for (a, layer) in layers.iter_mut().take(A::WIDE).enumerate() {
                        let row = row.wrapping_add(a);
                        let mut slab = [[zero; WIDEST]; WIDEST];
                        for (b, line) in slab.iter_mut().take(B::WIDE).enumerate() {
                            let col = col.wrapping_add(b);
                            if row < rows && col < cols {
                                for (c, value) in line.iter_mut().take(C::WIDE).enumerate() {
                                    let depth = depth.wrapping_add(c);
                                    if depth < depths {
                                        let cell = ((row * cols + col) * depths + depth) * channels;
                                        let from = input.as_ptr().add(cell + channel);
                                        *value = load::<V>(from, left).at_least(floor);
                                    }
                                }
                            }
                            C::forward(line);
                        }
                        for c in 0..C::WIDE {
                            let mut line = [zero; WIDEST];
                            for b in 0..B::WIDE {
                                line[b] = slab[b][c];
                            }
                            B::forward(&mut line);
                            for b in 0..B::WIDE {
                                layer[b * C::WIDE + c] = line[b];
                            }
                        }
                    }
                    let out = self.out.as_mut_ptr().add(nth * spread.tile + channel);
                    for place in 0..across {
                        let mut line = [zero; WIDEST];
                        for a in 0..A::WIDE {
                            line[a] = layers[a][place];
                        }
                        A::forward(&mut line);
                        for (a, value) in line.iter().take(A::WIDE).enumerate() {
                            value.store(out.add((a * across + place) * spread.frequency));
                        }
                    }
                }
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
    pub axes: PhantomData<(A, B, C)>,
}

impl<A: Axis, B: Axis, C: Axis> Task for Backward<'_, A, B, C> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { grid, products, spread, channels, bias, .. } = self;
        let [_, cols, depths] = grid.size;
        let across = B::WIDE * C::WIDE;
        let vectors = channels.next_multiple_of(V::LANES);
        assert!(spread.tile >= vectors && bias.len() >= vectors && self.first <= self.tiles.start);
        let last = (A::WIDE * across - 1) * spread.frequency + (self.tiles.end - self.first) * spread.tile;
        assert!(products.len() >= last);
        let rows = self.layer..self.layer + self.out.len() / (cols * depths * channels);
        // SAFETY: the instructions are there, as the caller says. The last product that is read is there; what is
        // written is among the rows that `out` has, and has all channels of the vector or goes through a buffer.
        unsafe {
            let zero = V::splat(0.0);
            let mut layers = [[zero; WIDEST * WIDEST]; WIDEST];
            for tile in self.tiles {
                let [i, j, k] = grid.place(tile);
                for channel in (0..channels).step_by(V::LANES) {
                    let left = channels - channel;
                    let bias = V::load(bias.as_ptr().add(channel));
                    let from = products.as_ptr().add((tile - self.first) * spread.tile + channel);
                    for place in 0..across {
                        let mut line = [zero; WIDEST];
                        for (a, value) in line.iter_mut().take(A::WIDE).enumerate() {
                            *value = V::load(from.add((a * across + place) * spread.frequency));
                        }
                        A::backward(&mut line);
                        for a in 0..A::TILE {
                            layers[a][place] = line[a];
                        }
                    }
                    for (a, layer) in layers.iter().take(A::TILE).enumerate() {
                        let row = i * A::TILE + a;
                        if !rows.contains(&row) {
                            continue;
                        }
                        let mut slab = [[zero; WIDEST]; WIDEST];
                        for c in 0..C::WIDE {
                            let mut line = [zero; WIDEST];
                            for b in 0..B::WIDE {
                                line[b] = layer[b * C::WIDE + c];
                            }
                            B::backward(&mut line);
                            for b in 0..B::TILE {
                                slab[b][c] = line[b];
                            }
                        }
                        for (b, line) in slab.iter_mut().take(B::TILE).enumerate() {
                            let col = j * B::TILE + b;
                            C::backward(line);
                            for (c, value) in line.iter().take(C::TILE).enumerate() {
                                let depth = k * C::TILE + c;
                                if col < cols && depth < depths {
                                    let cell = ((row - rows.start) * cols + col) * depths + depth;
                                    let to = self.out.as_mut_ptr().add(cell * channels + channel);
                                    let mut sum = value.plus(bias);
                                    if self.add {
                                        sum = sum.plus(load::<V>(to, left));
                                    }
                                    store::<V>(sum, to, left);
                                }
                            }
                        }
                    }
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
