//! What all drawings say, understood as a volume: occupancy of the half world grid.

use super::attention::Attention;
use super::block::{Block, Kind, add_twice};
use super::dense::Dense;
use super::reading::{EVIDENCE, VOXELS, inputs};
use super::weights::Weights;
use super::widths::Widths;
use crate::convolution::Convolution;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::exponential::sigmoid;
use crate::lift::HALF;
use rayon::prelude::*;

/// Numbers of the code that the condition becomes.
const CODE: usize = 32;
/// Sides of the volumes on the way down.
const SIZES: [[usize; 3]; 3] = [[32, 32, 16], [16, 16, 8], [8, 8, 4]];
/// Cells that a thread takes at a time.
const CELLS: usize = 512;

/// A residual U-Net between 32 and 8 cells along x and y, without its first layer.
pub struct Decoder {
    condition: Dense,
    /// The prior's share of the first layer: `VOXELS` x its outputs.
    prior: Vec<f32>,
    encode: [Block; 3],
    down: [Convolution; 2],
    attention: Attention,
    decode: [Block; 3],
    up: [Convolution; 2],
    out: Convolution,
    widths: [usize; 3],
}

/// The first layer, and beside it the shortcut from the same inputs to the output.
pub struct First {
    /// Outputs x inputs (`reading::inputs`).
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
}

impl Decoder {
    pub fn of(weights: &mut Weights<'_>, widths: &Widths) -> Result<(Self, First), CoreError> {
        let ([w32, w16, w8], inputs) = (widths.world, inputs(widths));
        let kind = Kind { axes: 3, groups: widths.groups, code: CODE };
        let name = |part: &str| format!("decoder.{part}");
        let condition = Dense::of(weights, &name("condition.0"), 2, CODE)?;
        let into = weights.linear(&name("into"), inputs, w32, 3)?;
        let encode32 = Block::of(weights, &name("encode32"), w32, kind)?;
        let down16 = weights.halving(&name("down16"), w32, w16, 3)?;
        let encode16 = Block::of(weights, &name("encode16"), w16, kind)?;
        let down8 = weights.halving(&name("down8"), w16, w8, 3)?;
        let encode8 = Block::of(weights, &name("encode8"), w8, kind)?;
        let attention = Attention::of(weights, &name("attention"), w8, SIZES[2].iter().product())?;
        let decode8 = Block::of(weights, &name("decode8"), w8, kind)?;
        let up16 = weights.point(&name("up16"), w8, w16, 3)?;
        let decode16 = Block::of(weights, &name("decode16"), w16, kind)?;
        let up32 = weights.point(&name("up32"), w16, w32, 3)?;
        let decode32 = Block::of(weights, &name("decode32"), w32, kind)?;
        let out = weights.three(&name("out"), [w32, VOXELS], 3, true)?;
        let shortcut = weights.linear(&name("shortcut"), inputs, VOXELS, 3)?;
        let first = First { weight: [into.0, shortcut.0].concat(), bias: [into.1, shortcut.1].concat() };
        let place = 2 * widths.fused + VOXELS * EVIDENCE;
        let column = |voxel: usize| first.weight.chunks_exact(inputs).map(move |row| row[place + voxel]);
        let decoder = Self {
            condition,
            prior: (0..VOXELS).flat_map(column).collect(),
            encode: [encode32, encode16, encode8],
            down: [down16, down8],
            attention,
            decode: [decode8, decode16, decode32],
            up: [up16, up32],
            out,
            widths: widths.world,
        };
        Ok((decoder, first))
    }

    /// Room for `apply`.
    pub fn room(&self) -> Room {
        let level = |i: usize| vec![0.0; SIZES[i].iter().product::<usize>() * self.widths[i]];
        let levels = [level(0), level(1), level(2)];
        let scratch = vec![0.0; levels.iter().map(Vec::len).max().unwrap_or(0)];
        Room { levels, scratch }
    }

    /// Probability of occupancy of each cell's voxels, `HALF` x `VOXELS`, from what `Reading::finish` made, given a prior
    /// of the same form and the number of drawings.
    pub fn apply(
        &self,
        readings: &[f32],
        prior: Option<&[f32]>,
        drawings: usize,
        room: &mut Room,
        out: &mut [f32],
    ) {
        let code = self.condition.rectified(&[f32::from(u8::from(prior.is_some())), drawings as f32 / 4.0]);
        let Room { levels: [x32, x16, x8], scratch } = room;
        self.begin(readings, prior, x32, out);
        self.encode[0].apply(x32, SIZES[0], &code, scratch);
        self.down[0].apply(x32, SIZES[0], true, false, x16);
        self.encode[1].apply(x16, SIZES[1], &code, scratch);
        self.down[1].apply(x16, SIZES[1], true, false, x8);
        self.encode[2].apply(x8, SIZES[2], &code, scratch);
        self.attention.apply(x8);
        self.decode[0].apply(x8, SIZES[2], &code, scratch);
        // A map of single cells gives the same before cells are doubled as after it.
        let coarse = &mut scratch[..x16.len() / 8];
        self.up[0].apply(x8, SIZES[2], true, false, coarse);
        add_twice(coarse, SIZES[2], x16);
        self.decode[1].apply(x16, SIZES[1], &code, scratch);
        let coarse = &mut scratch[..x32.len() / 8];
        self.up[1].apply(x16, SIZES[1], true, false, coarse);
        add_twice(coarse, SIZES[1], x32);
        self.decode[2].apply(x32, SIZES[0], &code, scratch);
        self.out.apply(x32, SIZES[0], true, true, out);
        out.par_chunks_mut(CELLS * VOXELS).for_each(sigmoid);
    }

    /// Adds the prior's share to what the first layer and the shortcut made of all else.
    fn begin(&self, readings: &[f32], prior: Option<&[f32]>, x: &mut [f32], shortcut: &mut [f32]) {
        let width = self.widths[0];
        assert_eq!(readings.len(), HALF * (width + VOXELS));
        let cells = x.par_chunks_mut(CELLS * width).zip(shortcut.par_chunks_mut(CELLS * VOXELS));
        cells.zip(readings.par_chunks(CELLS * (width + VOXELS))).enumerate().for_each(
            |(job, ((x, shortcut), readings))| {
                let prior = prior.map(|prior| &prior[job * CELLS * VOXELS..][..CELLS * VOXELS]);
                add_prior(readings, prior, &self.prior, x, shortcut);
            },
        );
    }
}

/// What a decoder works in.
pub struct Room {
    levels: [Vec<f32>; 3],
    scratch: Vec<f32>,
}

for_each_instruction_set! {
fn add_prior(readings: &[f32], prior: Option<&[f32]>, weight: &[f32], x: &mut [f32], shortcut: &mut [f32]) {
    let outputs = weight.len() / VOXELS;
    let width = outputs - VOXELS;
    let cells = x.chunks_exact_mut(width).zip(shortcut.chunks_exact_mut(VOXELS));
    for (cell, ((x, shortcut), reading)) in cells.zip(readings.chunks_exact(outputs)).enumerate() {
        x.copy_from_slice(&reading[..width]);
        shortcut.copy_from_slice(&reading[width..]);
        let Some(prior) = prior else { continue };
        for (value, weight) in prior[cell * VOXELS..][..VOXELS].iter().zip(weight.chunks_exact(outputs)) {
            let (for_x, for_shortcut) = weight.split_at(width);
            x.iter_mut().zip(for_x).for_each(|(x, w)| *x += value * w);
            shortcut.iter_mut().zip(for_shortcut).for_each(|(s, w)| *s += value * w);
        }
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prior_adds_its_share_to_both_layers() {
        let (width, cells) = (5, 3);
        let wave = |n: usize, pace: f64| (0..n).map(|i| (i as f64 * pace).sin() as f32).collect::<Vec<_>>();
        let (readings, prior) = (wave(cells * (width + 8), 0.3), wave(cells * 8, 0.7));
        let weight = wave(8 * (width + 8), 1.1);
        let (mut x, mut shortcut) = (vec![0.0; cells * width], vec![0.0; cells * 8]);
        add_prior(&readings, Some(&prior), &weight, &mut x, &mut shortcut);
        for cell in 0..cells {
            for out in 0..width + 8 {
                let share: f32 = (0..8).map(|v| prior[cell * 8 + v] * weight[v * (width + 8) + out]).sum();
                let expected = readings[cell * (width + 8) + out] + share;
                let got = if out < width { x[cell * width + out] } else { shortcut[cell * 8 + out - width] };
                assert!((got - expected).abs() < 1e-6);
            }
        }
        add_prior(&readings, None, &weight, &mut x, &mut shortcut);
        assert_eq!((x[0], shortcut[8]), (readings[0], readings[width + 8 + width]));
    }
}
