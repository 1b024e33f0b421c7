//! Reading a volume between its cells' centres, trilinear; what lies outside the volume is 0.

use glam::{Mat4, Vec3, Vec4};
use std::ops::Range;

/// Reads a volume of N^3 cells at one position, in cells.
pub fn trilinear<const N: usize>(volume: &[f32], at: Vec3) -> f32 {
    let side = N as f32;
    if !(at.min_element() > -1.0 && at.max_element() < side) {
        return 0.0;
    }
    // One more than the lower neighbour along each axis, so that truncation rounds down.
    let up = at + 1.0;
    let (i, j, k) = (up.x as usize, up.y as usize, up.z as usize);
    let f = up - Vec3::new(i as f32, j as f32, k as f32);
    let inner = 1..N;
    if inner.contains(&i) && inner.contains(&j) && inner.contains(&k) {
        let base = ((i - 1) * N + j - 1) * N + k - 1;
        let block = &volume[base..base + N * N + N + 2];
        let pair = |o: usize| block[o] + f.z * (block[o + 1] - block[o]);
        let (a, b) = (pair(0), pair(N));
        let (c, d) = (pair(N * N), pair(N * N + N));
        let (low, high) = (a + f.y * (b - a), c + f.y * (d - c));
        return low + f.x * (high - low);
    }
    let mut sum = 0.0;
    for corner in 0..8 {
        let (ci, cj, ck) = (i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1));
        let inside = 1..=N;
        if inside.contains(&ci) && inside.contains(&cj) && inside.contains(&ck) {
            let weight = |upper: bool, t: f32| if upper { t } else { 1.0 - t };
            let index = ((ci - 1) * N + cj - 1) * N + ck - 1;
            sum += volume[index] * weight(ci > i, f.x) * weight(cj > j, f.y) * weight(ck > k, f.z);
        }
    }
    sum
}

/// The cells along a line of a grid.
pub type Line<const N: usize> = [f32; N];
/// A grid's cells, N along each side.
pub type Grid<const N: usize> = [[Line<N>; N]; N];

/// A volume with a layer of zeros all around it, so that no neighbour of a position up to one cell outside is missing.
pub struct Padded<const N: usize>(Vec<f32>);

impl<const N: usize> Default for Padded<N> {
    fn default() -> Self {
        Self(vec![0.0; Self::CELLS])
    }
}

impl<const N: usize> Padded<N> {
    /// Centres along each side.
    const SIDE: usize = N + 2;
    /// From a plane to the next. No multiple of a page, unlike that of the volume itself: else the planes would push
    /// each other out of the caches.
    const STRIDE: usize = Self::SIDE * Self::SIDE;
    const CELLS: usize = Self::SIDE * Self::STRIDE;

    /// Copies a volume, and says whether all of it is finite.
    #[must_use]
    #[inline(always)]
    pub fn fill(&mut self, volume: &Grid<N>) -> bool {
        let mut finite = true;
        for (padded, plane) in self.0[Self::STRIDE..].chunks_exact_mut(Self::STRIDE).zip(volume) {
            for (padded, row) in padded[Self::SIDE..].chunks_exact_mut(Self::SIDE).zip(plane) {
                padded[1..=N].copy_from_slice(row);
                finite &= row.iter().fold(true, |finite, v| finite & (v.abs() < f32::INFINITY));
            }
        }
        finite
    }
}

/// Where a line of positions reads a padded volume. Finding it is arithmetic on whole vectors, reading is loads:
/// apart, the processor has many of each under way, and neither waits for the other.
#[repr(align(64))]
pub struct Taps<const N: usize> {
    /// Index of the lowest of the eight neighbours.
    first: [u32; N],
    /// Shares of the upper neighbours along each axis.
    upper: [Line<N>; 3],
}

impl<const N: usize> Default for Taps<N> {
    fn default() -> Self {
        Self { first: [0; N], upper: [[0.0; N]; 3] }
    }
}

/// Added to a small number and taken away again, rounds it to an integer; the sum's lowest bits hold it.
const ROUND: f32 = 12_582_912.0;

/// The integer that a float holds, less than 2^22.
#[inline(always)]
fn whole(number: f32) -> u32 {
    (number + ROUND).to_bits() - ROUND.to_bits()
}

impl<const N: usize> Taps<N> {
    /// Positions in cells of the padded volume, where the volume's own first centre is at 1.
    #[inline(always)]
    pub fn fill(&mut self, at: impl Fn(usize) -> [f32; 3]) {
        let Self { first, upper: [upper_i, upper_j, upper_k] } = self;
        for cell in 0..N {
            let held = at(cell).map(|at| at.max(0.0).min((N + 1) as f32));
            // Half to even: at a centre either neighbour may be the lower one, with the same result.
            let [i, j, k] = held.map(|at| (at - 0.5 + ROUND) - ROUND);
            let in_plane = j * Padded::<N>::SIDE as f32 + k;
            // As long as floats hold every index, one rounding makes it an integer.
            first[cell] = if const { Padded::<N>::CELLS <= 1 << 22 } {
                whole(i * Padded::<N>::STRIDE as f32 + in_plane)
            } else {
                whole(i) * Padded::<N>::STRIDE as u32 + whole(in_plane)
            };
            (upper_i[cell], upper_j[cell], upper_k[cell]) = (held[0] - i, held[1] - j, held[2] - k);
        }
    }

    /// Reads some of the cells, and up to three more at either end, since it reads four at a time.
    #[inline(always)]
    pub fn read(&self, volume: &Padded<N>, cells: Range<usize>, out: &mut Line<N>) {
        let (side, stride) = (Padded::<N>::SIDE, Padded::<N>::STRIDE);
        // Its length is known from here on.
        let volume = &volume.0[..Padded::<N>::CELLS];
        let Self { first, upper: [upper_i, upper_j, upper_k] } = self;
        for four in cells.start / 4..cells.end.div_ceil(4) {
            let four = 4 * four..4 * four + 4;
            let of = |values: &Line<N>| Vec4::from_slice(&values[four.clone()]);
            let (first, upper_j) = (&first[four.clone()], &upper_j[four.clone()]);
            // A loop: a closure here is not always inlined.
            let mut cells = [Vec4::ZERO; 4];
            for l in 0..4 {
                let first = first[l] as usize;
                let v = &volume[first..first + stride + side + 2];
                let low = Vec4::new(v[0], v[1], v[stride], v[stride + 1]);
                let high = Vec4::new(v[side], v[side + 1], v[stride + side], v[stride + side + 1]);
                cells[l] = low + upper_j[l] * (high - low);
            }
            // From a vector for each cell to a vector for each neighbour.
            let Mat4 { x_axis: a, y_axis: b, z_axis: c, w_axis: d } =
                Mat4::from_cols(cells[0], cells[1], cells[2], cells[3]).transpose();
            let (upper_i, upper_k) = (of(upper_i), of(upper_k));
            let (low, high) = (a + upper_i * (c - a), b + upper_i * (d - b));
            out[four].copy_from_slice(&(low + upper_k * (high - low)).to_array());
        }
    }
}
