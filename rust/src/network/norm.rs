//! Normalisation of a sample by groups of channels, which a code then scales and shifts.

use super::weights::Weights;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use rayon::prelude::*;

/// What is added to a variance before it divides.
pub const EPSILON: f64 = 1e-5;
/// Cells that a thread takes at a time: so many are summed together at any number of threads, and sums are the same.
const CELLS: usize = 256;
/// Channels that are summed side by side.
const LANES: usize = 16;

/// Normalisation by groups of channels, which then have a scale and a shift each.
pub struct GroupNorm {
    scale: Vec<f32>,
    shift: Vec<f32>,
    groups: usize,
}

impl GroupNorm {
    pub fn of(weights: &mut Weights<'_>, name: &str, width: usize, groups: usize) -> Result<Self, CoreError> {
        let scale = weights.vector(&format!("{name}.weight"), width)?.to_vec();
        let shift = weights.vector(&format!("{name}.bias"), width)?.to_vec();
        Ok(Self { scale, shift, groups })
    }

    /// Normalises cells x channels, then multiplies each channel by 1 + its number in the first half of `film`, and
    /// adds that in the second half.
    pub fn apply(&self, values: &mut [f32], film: &[f32]) {
        let width = self.scale.len();
        assert_eq!(values.len() % width, 0);
        assert_eq!(film.len(), 2 * width);
        let cells = values.len() / width;
        let maps = self.maps(&moments(values, width), cells, film);
        values.par_chunks_mut(CELLS * width).for_each(|values| map_channels(values, &maps));
    }

    /// What is subtracted from each channel, what it is then multiplied by, and what is added, given its sums.
    fn maps(&self, moments: &[[f64; 2]], cells: usize, film: &[f32]) -> [Vec<f32>; 3] {
        let width = self.scale.len();
        let each = width / self.groups;
        let mut maps = [vec![0.0; width], vec![0.0; width], vec![0.0; width]];
        for channel in 0..width {
            let group = &moments[channel / each * each..][..each];
            let average = |of: usize| group.iter().map(|m| m[of]).sum::<f64>() / (cells * each) as f64;
            let (mean, square) = (average(0), average(1));
            let deviation = ((square - mean * mean).max(0.0) + EPSILON).sqrt();
            let times = 1.0 + film[channel];
            maps[0][channel] = mean as f32;
            maps[1][channel] = (1.0 / deviation) as f32 * self.scale[channel] * times;
            maps[2][channel] = self.shift[channel] * times + film[width + channel];
        }
        maps
    }
}

/// The sum of each channel, and that of its squares.
fn moments(values: &[f32], width: usize) -> Vec<[f64; 2]> {
    let mut parts = vec![[0.0; 2]; values.len().div_ceil(CELLS * width) * width];
    let jobs = parts.par_chunks_mut(width).zip(values.par_chunks(CELLS * width));
    jobs.for_each(|(out, values)| sum_channels(values, out));
    let (total, rest) = parts.split_at_mut(width);
    for part in rest.chunks_exact(width) {
        for (total, part) in total.iter_mut().zip(part) {
            *total = [total[0] + part[0], total[1] + part[1]];
        }
    }
    parts.truncate(width);
    parts
}

for_each_instruction_set! {
/// Sums how far cells are from the first one, and the squares of that: single precision is enough, however far from 0
/// all of them are.
fn sum_channels(values: &[f32], out: &mut [[f64; 2]]) {
    let width = out.len();
    let cells = (values.len() / width) as f64;
    for (block, out) in out.chunks_mut(LANES).enumerate() {
        let (mut sums, mut squares) = ([0.0f32; LANES], [0.0f32; LANES]);
        let first = &values[block * LANES..][..out.len()];
        for cell in values.chunks_exact(width) {
            let cell = &cell[block * LANES..][..first.len()];
            if let (Some(cell), Some(first)) = (cell.first_chunk::<LANES>(), first.first_chunk::<LANES>()) {
                for lane in 0..LANES {
                    let off = cell[lane] - first[lane];
                    sums[lane] += off;
                    squares[lane] += off * off;
                }
            } else {
                for lane in 0..first.len() {
                    let off = cell[lane] - first[lane];
                    sums[lane] += off;
                    squares[lane] += off * off;
                }
            }
        }
        for (lane, out) in out.iter_mut().enumerate() {
            let (start, sum, square) = (f64::from(first[lane]), f64::from(sums[lane]), f64::from(squares[lane]));
            *out = [start * cells + sum, square + (2.0 * sum + start * cells) * start];
        }
    }
}
}

for_each_instruction_set! {
fn map_channels(values: &mut [f32], [means, scales, shifts]: &[Vec<f32>; 3]) {
    for cell in values.chunks_exact_mut(means.len()) {
        for (((value, mean), scale), shift) in cell.iter_mut().zip(means).zip(scales).zip(shifts) {
            *value = (*value - mean) * scale + shift;
        }
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_group_has_mean_0_and_variance_1_wherever_it_was_before_the_code_changes_it() {
        let (cells, width, groups) = (3 * CELLS + 7, 24, 4);
        let norm = GroupNorm { scale: vec![1.0; width], shift: vec![0.0; width], groups };
        for far in [0.0, 1e4] {
            let place = |i: usize| far + ((i * 7919) % 1013) as f32 / 100.0;
            let mut values: Vec<f32> = (0..cells * width).map(place).collect();
            let film: Vec<f32> = (0..2 * width).map(|i| if i < width { 1.0 } else { i as f32 }).collect();
            norm.apply(&mut values, &film);
            for group in 0..groups {
                let own = values.iter().enumerate().filter(|(i, _)| i % width / (width / groups) == group);
                let off = own.map(|(i, v)| f64::from(*v) - (width + i % width) as f64);
                let (sum, square) = off.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
                let count = (cells * width / groups) as f64;
                assert!((sum / count).abs() < 1e-2, "{}", sum / count);
                assert!((square / count - 4.0).abs() < 1e-2, "{}", square / count);
            }
        }
    }

    #[test]
    fn a_channel_that_is_the_same_everywhere_becomes_its_shift() {
        let norm = GroupNorm { scale: vec![3.0], shift: vec![0.5], groups: 1 };
        let mut values = [7e3; 100];
        norm.apply(&mut values, &[0.0, 0.25]);
        assert!(values.iter().all(|v| (v - 0.75).abs() < 1e-6), "{:?}", &values[..3]);
    }
}
