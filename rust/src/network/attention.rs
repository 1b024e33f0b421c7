//! Self-attention over all cells of a coarse image or volume.

use super::norm::EPSILON;
use super::weights::Weights;
use crate::convolution::{Convolution, multiply};
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::exponential::exponential;
use rayon::prelude::*;

/// Attention heads.
pub const HEADS: usize = 8;
/// Numbers that are summed side by side.
const LANES: usize = 16;

/// Attention with its normalisation, to which every cell adds what is known of its place.
pub struct Attention {
    place: Vec<f32>,
    scale: Vec<f32>,
    shift: Vec<f32>,
    into: Convolution,
    out: Convolution,
}

impl Attention {
    pub fn of(weights: &mut Weights<'_>, name: &str, width: usize, cells: usize) -> Result<Self, CoreError> {
        let place = weights.take(&format!("{name}.place"), &[1, cells, width])?.to_vec();
        let scale = weights.vector(&format!("{name}.norm.weight"), width)?.to_vec();
        let shift = weights.vector(&format!("{name}.norm.bias"), width)?.to_vec();
        let into = weights.point(&format!("{name}.into"), width, 3 * width, 0)?;
        let out = weights.point(&format!("{name}.out"), width, width, 0)?;
        Ok(Self { place, scale, shift, into, out })
    }

    /// Adds to each cell of cells x channels what it sees in the others.
    pub fn apply(&self, x: &mut [f32]) {
        let width = self.scale.len();
        let cells = self.place.len() / width;
        let mut seen = x.to_vec();
        normalise_rows(&mut seen, &self.place, &self.scale, &self.shift);
        let mut parts = vec![0.0; 3 * x.len()];
        self.into.apply(&seen, [cells, 1, 1], false, false, &mut parts);
        let each: Vec<_> = (0..HEADS).into_par_iter().map(|head| look(&parts, width, head)).collect();
        for (cell, seen) in seen.chunks_exact_mut(width).enumerate() {
            for (head, out) in each.iter().zip(seen.chunks_exact_mut(width / HEADS)) {
                out.copy_from_slice(&head[cell * out.len()..][..out.len()]);
            }
        }
        self.out.apply(&seen, [cells, 1, 1], false, true, x);
    }
}

/// What one head sees at every cell, cells x (width / heads), given queries, keys and values of all heads.
fn look(parts: &[f32], width: usize, head: usize) -> Vec<f32> {
    let (cells, own) = (parts.len() / (3 * width), width / HEADS);
    let rows = |part: usize| {
        let first = part * width + head * own;
        parts.chunks_exact(3 * width).map(move |row| &row[first..][..own])
    };
    let queries: Vec<f32> = rows(0).flatten().map(|q| q / (own as f32).sqrt()).collect();
    let mut keys = vec![0.0; own * cells];
    for (cell, row) in rows(1).enumerate() {
        row.iter().enumerate().for_each(|(i, key)| keys[i * cells + cell] = *key);
    }
    let values: Vec<f32> = rows(2).flatten().copied().collect();
    let mut shares = vec![0.0; cells * cells];
    multiply(&queries, &keys, cells, own, cells, false, &mut shares);
    share_rows(&mut shares, cells);
    let mut seen = queries;
    multiply(&shares, &values, cells, cells, own, false, &mut seen);
    seen
}

for_each_instruction_set! {
/// Adds its place to each row, gives it mean 0 and variance 1, and scales and shifts its columns.
fn normalise_rows(values: &mut [f32], place: &[f32], scale: &[f32], shift: &[f32]) {
    let width = scale.len();
    for (row, place) in values.chunks_exact_mut(width).zip(place.chunks_exact(width)) {
        row.iter_mut().zip(place).for_each(|(v, p)| *v += p);
        let mean = sum(row) / width as f32;
        row.iter_mut().for_each(|v| *v -= mean);
        let by = 1.0 / (sum_of_squares(row) / width as f32 + EPSILON as f32).sqrt();
        for ((v, scale), shift) in row.iter_mut().zip(scale).zip(shift) {
            *v = *v * by * scale + shift;
        }
    }
}
}

for_each_instruction_set! {
/// Exponentials of each row, divided by their sum.
fn share_rows(values: &mut [f32], width: usize) {
    for row in values.chunks_exact_mut(width) {
        let most = largest(row);
        row.iter_mut().for_each(|v| *v = exponential(*v - most));
        let by = 1.0 / sum(row);
        row.iter_mut().for_each(|v| *v *= by);
    }
}
}

#[inline(always)]
fn largest(values: &[f32]) -> f32 {
    let (lanes, rest) = values.as_chunks::<LANES>();
    let mut most = [f32::NEG_INFINITY; LANES];
    for values in lanes {
        for lane in 0..LANES {
            most[lane] = if values[lane] > most[lane] { values[lane] } else { most[lane] };
        }
    }
    most.iter().chain(rest).fold(f32::NEG_INFINITY, |most, &v| if v > most { v } else { most })
}

#[inline(always)]
fn sum(values: &[f32]) -> f32 {
    let (lanes, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for values in lanes {
        for lane in 0..LANES {
            sums[lane] += values[lane];
        }
    }
    sums.iter().chain(rest).sum()
}

#[inline(always)]
fn sum_of_squares(values: &[f32]) -> f32 {
    let (lanes, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for values in lanes {
        for lane in 0..LANES {
            sums[lane] += values[lane] * values[lane];
        }
    }
    sums.iter().sum::<f32>() + rest.iter().map(|v| v * v).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(count: usize, pace: f64) -> Vec<f32> {
        (0..count).map(|i| (i as f64 * pace).sin() as f32).collect()
    }

    #[test]
    fn a_head_sees_the_mean_of_values_weighted_by_how_keys_answer_queries() {
        let (cells, own) = (19, 3);
        let width = own * HEADS;
        let parts: Vec<f32> = wave(cells * 3 * width, 0.37).iter().map(|v| 3.0 * v).collect();
        let part = |part: usize, cell: usize, head: usize, i: usize| {
            f64::from(parts[cell * 3 * width + part * width + head * own + i])
        };
        for head in [0, 5] {
            let seen = look(&parts, width, head);
            for cell in 0..cells {
                let answer = |other: usize| {
                    let dot: f64 = (0..own).map(|i| part(0, cell, head, i) * part(1, other, head, i)).sum();
                    (dot / (own as f64).sqrt()).exp()
                };
                let total: f64 = (0..cells).map(answer).sum();
                for i in 0..own {
                    let mean =
                        (0..cells).map(|other| answer(other) * part(2, other, head, i)).sum::<f64>() / total;
                    assert!((mean - f64::from(seen[cell * own + i])).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn rows_have_mean_0_and_variance_1_before_they_are_scaled() {
        let width = 21;
        let (mut values, place) = (wave(4 * width, 0.9), wave(4 * width, 0.11));
        let sums: Vec<f32> = values.iter().zip(&place).map(|(v, p)| v + p).collect();
        normalise_rows(&mut values, &place, &vec![2.0; width], &vec![1.0; width]);
        for (row, was) in values.chunks_exact(width).zip(sums.chunks_exact(width)) {
            let mean = was.iter().sum::<f32>() / width as f32;
            let variance = was.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / width as f32;
            for (v, was) in row.iter().zip(was) {
                assert!((v - (2.0 * (was - mean) / variance.sqrt() + 1.0)).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_nan_stays_in_its_row() {
        let mut values = wave(32, 0.5);
        values[3] = f32::NAN;
        share_rows(&mut values, 16);
        assert!(values[..16].iter().all(|v| v.is_nan()));
        assert!((values[16..].iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }
}
