//! Reading a volume between its cells' centres, trilinear; what lies outside the volume is 0.

use crate::voxel::{CELLS, SIDE};
use glam::{Mat4, Vec3, Vec4};
use std::ops::Range;

/// Reads a volume at one position, in cells.
pub fn trilinear(volume: &[f32], at: Vec3) -> f32 {
    let side = SIDE as f32;
    if !(at.min_element() > -1.0 && at.max_element() < side) {
        return 0.0;
    }
    // One more than the lower neighbour along each axis, so that truncation rounds down.
    let up = at + 1.0;
    let (i, j, k) = (up.x as usize, up.y as usize, up.z as usize);
    let f = up - Vec3::new(i as f32, j as f32, k as f32);
    let inner = 1..SIDE;
    if inner.contains(&i) && inner.contains(&j) && inner.contains(&k) {
        let base = ((i - 1) * SIDE + j - 1) * SIDE + k - 1;
        let block = &volume[base..base + SIDE * SIDE + SIDE + 2];
        let pair = |o: usize| block[o] + f.z * (block[o + 1] - block[o]);
        let (a, b) = (pair(0), pair(SIDE));
        let (c, d) = (pair(SIDE * SIDE), pair(SIDE * SIDE + SIDE));
        let (low, high) = (a + f.y * (b - a), c + f.y * (d - c));
        return low + f.x * (high - low);
    }
    let mut sum = 0.0;
    for corner in 0..8 {
        let (ci, cj, ck) = (i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1));
        let inside = 1..=SIDE;
        if inside.contains(&ci) && inside.contains(&cj) && inside.contains(&ck) {
            let weight = |upper: bool, t: f32| if upper { t } else { 1.0 - t };
            let index = ((ci - 1) * SIDE + cj - 1) * SIDE + ck - 1;
            sum += volume[index] * weight(ci > i, f.x) * weight(cj > j, f.y) * weight(ck > k, f.z);
        }
    }
    sum
}

/// Centres along each side of a padded volume.
const PADDED: usize = SIDE + 2;
/// From a plane of a padded volume to the next. No multiple of a page, unlike that of the volume itself: else the
/// planes would push each other out of the caches.
const STRIDE: usize = PADDED * PADDED;

/// A volume with a layer of zeros all around it, so that no neighbour of a position up to one cell outside is missing.
pub struct Padded(Vec<f32>);

impl Default for Padded {
    fn default() -> Self {
        Self(vec![0.0; PADDED * STRIDE])
    }
}

impl Padded {
    /// Copies a volume, and says whether all of it is finite.
    #[must_use]
    #[inline(always)]
    pub fn fill(&mut self, volume: &[f32; CELLS]) -> bool {
        let mut finite = true;
        let planes = self.0[STRIDE..].chunks_exact_mut(STRIDE).zip(volume.chunks_exact(SIDE * SIDE));
        for (padded, plane) in planes {
            let rows = padded[PADDED..].chunks_exact_mut(PADDED).zip(plane.as_chunks::<SIDE>().0);
            for (padded, row) in rows {
                padded[1..=SIDE].copy_from_slice(row);
                finite &= row.iter().fold(true, |finite, v| finite & (v.abs() < f32::INFINITY));
            }
        }
        finite
    }
}

/// Where a line of 64 positions reads a padded volume. Finding it is arithmetic on whole vectors, reading is loads:
/// apart, the processor has many of each under way, and neither waits for the other.
#[repr(align(64))]
pub struct Taps {
    /// Index of the lowest of the eight neighbours.
    first: [u32; SIDE],
    /// Shares of the upper neighbours along each axis.
    upper: [[f32; SIDE]; 3],
}

impl Default for Taps {
    fn default() -> Self {
        Self { first: [0; SIDE], upper: [[0.0; SIDE]; 3] }
    }
}

/// Added to a small number and taken away again, rounds it to an integer; the sum's lowest bits hold it.
const ROUND: f32 = 12_582_912.0;

impl Taps {
    /// Positions in cells of the padded volume, where the volume's own first centre is at 1.
    #[inline(always)]
    pub fn fill(&mut self, at: impl Fn(usize) -> [f32; 3]) {
        let Self { first, upper: [upper_i, upper_j, upper_k] } = self;
        for cell in 0..SIDE {
            let held = at(cell).map(|at| at.max(0.0).min((PADDED - 1) as f32));
            // Half to even: at a centre either neighbour may be the lower one, with the same result.
            let [i, j, k] = held.map(|at| (at - 0.5 + ROUND) - ROUND);
            let index = i * STRIDE as f32 + j * PADDED as f32 + k;
            first[cell] = (index + ROUND).to_bits() - ROUND.to_bits();
            (upper_i[cell], upper_j[cell], upper_k[cell]) = (held[0] - i, held[1] - j, held[2] - k);
        }
    }

    /// Reads some of the cells, and up to three more at either end, since it reads four at a time.
    #[inline(always)]
    pub fn read(&self, volume: &Padded, cells: Range<usize>, out: &mut [f32; SIDE]) {
        let volume: &[f32; PADDED * STRIDE] = volume.0.as_slice().try_into().expect("a padded volume");
        let Self { first, upper: [upper_i, upper_j, upper_k] } = self;
        for four in cells.start / 4..cells.end.div_ceil(4) {
            let four = 4 * four..4 * four + 4;
            let of = |values: &[f32; SIDE]| Vec4::from_slice(&values[four.clone()]);
            let (first, upper_j) = (&first[four.clone()], &upper_j[four.clone()]);
            let cells: [Vec4; 4] = std::array::from_fn(|l| {
                let first = first[l] as usize;
                let v = &volume[first..first + STRIDE + PADDED + 2];
                let low = Vec4::new(v[0], v[1], v[STRIDE], v[STRIDE + 1]);
                let high = Vec4::new(v[PADDED], v[PADDED + 1], v[STRIDE + PADDED], v[STRIDE + PADDED + 1]);
                low + upper_j[l] * (high - low)
            });
            // From a vector for each cell to a vector for each neighbour.
            let Mat4 { x_axis: a, y_axis: b, z_axis: c, w_axis: d } =
                Mat4::from_cols(cells[0], cells[1], cells[2], cells[3]).transpose();
            let (upper_i, upper_k) = (of(upper_i), of(upper_k));
            let (low, high) = (a + upper_i * (c - a), b + upper_i * (d - b));
            out[four].copy_from_slice(&(low + upper_k * (high - low)).to_array());
        }
    }
}
