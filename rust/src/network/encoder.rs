//! A drawing understood as an image: features for every pixel and depth of its frustum.

use super::attention::Attention;
use super::block::{Block, Kind, add_twice};
use super::dense::Dense;
use super::weights::Weights;
use super::widths::Widths;
use crate::camera::IMAGE;
use crate::convolution::Convolution;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::evidence::FIELDS;
use crate::lift::{BINS, ENTRIES, PLANE};
use rayon::prelude::*;

/// Numbers of the code that the camera's rotation becomes.
const CODE: usize = 64;
/// Pixels of a drawing along each side of one of its features.
const FOLD: usize = IMAGE / PLANE;
/// Channels of a drawing and its two fields.
const CHANNELS: usize = 3 * FOLD * FOLD;
/// Sides of the images on the way down.
const SIZES: [[usize; 3]; 4] = [[64, 64, 1], [32, 32, 1], [16, 16, 1], [8, 8, 1]];

/// A residual U-Net between 64^2 and 8^2 pixels, told the camera's rotation.
pub struct Encoder {
    condition: [Dense; 2],
    into: Convolution,
    down: [Convolution; 3],
    encode: [Block; 3],
    attention: Attention,
    up: [Convolution; 3],
    decode: [Block; 2],
    fine: Convolution,
    out: Convolution,
    widths: [usize; 4],
    features: usize,
}

impl Encoder {
    pub fn of(weights: &mut Weights<'_>, widths: &Widths) -> Result<Self, CoreError> {
        let (stem, [w32, w16, w8]) = (widths.stem, widths.image);
        let kind = Kind { axes: 2, groups: widths.groups, code: CODE };
        let name = |part: &str| format!("encoder.{part}");
        let condition = [
            Dense::of(weights, &name("condition.0"), 9, CODE)?,
            Dense::of(weights, &name("condition.2"), CODE, CODE)?,
        ];
        let into = weights.three(&name("into"), [CHANNELS, stem], 2, true)?;
        let down32 = weights.halving(&name("down32"), stem, w32, 2)?;
        let encode32 = Block::of(weights, &name("encode32"), w32, kind)?;
        let down16 = weights.halving(&name("down16"), w32, w16, 2)?;
        let encode16 = Block::of(weights, &name("encode16"), w16, kind)?;
        let down8 = weights.halving(&name("down8"), w16, w8, 2)?;
        let encode8 = Block::of(weights, &name("encode8"), w8, kind)?;
        let attention = Attention::of(weights, &name("attention"), w8, SIZES[3].iter().product())?;
        let up16 = weights.point(&name("up16"), w8, w16, 2)?;
        let decode16 = Block::of(weights, &name("decode16"), w16, kind)?;
        let up32 = weights.point(&name("up32"), w16, w32, 2)?;
        let decode32 = Block::of(weights, &name("decode32"), w32, kind)?;
        let up64 = weights.point(&name("up64"), w32, stem, 2)?;
        let fine = weights.three(&name("fine"), [2 * stem, stem], 2, true)?;
        let out = weights.point(&name("out"), stem, BINS * widths.features, 2)?;
        Ok(Self {
            condition,
            into,
            down: [down32, down16, down8],
            encode: [encode32, encode16, encode8],
            attention,
            up: [up16, up32, up64],
            decode: [decode16, decode32],
            fine,
            out,
            widths: [stem, w32, w16, w8],
            features: widths.features,
        })
    }

    /// Room for `apply`.
    pub fn room(&self) -> Room {
        let level = |i: usize| vec![0.0; SIZES[i].iter().product::<usize>() * self.widths[i]];
        let pixels = PLANE * PLANE;
        Room {
            levels: [level(0), level(1), level(2), level(3)],
            scratch: vec![
                0.0;
                (CHANNELS * pixels).max(level(1).len()).max(level(2).len()).max(level(3).len())
            ],
            joined: vec![0.0; 2 * pixels * self.widths[0]],
            features: vec![0.0; ENTRIES * self.features],
        }
    }

    /// Describes a drawing, `IMAGE`^2 bytes, with its fields, `FIELDS` bytes, seen by a camera of the rotation given row
    /// by row. In the room given, or rather in its `features`.
    pub fn apply(&self, drawing: &[u8], fields: &[u8], rotation: &[f32; 9], room: &mut Room) {
        let code = self.condition[1].rectified(&self.condition[0].rectified(rotation));
        let Room { levels: [x64, x32, x16, x8], scratch, joined, features } = room;
        let image = &mut scratch[..CHANNELS * PLANE * PLANE];
        fold_images(drawing, fields, image);
        self.into.apply(image, SIZES[0], false, false, x64);
        self.down[0].apply(x64, SIZES[0], true, false, x32);
        self.encode[0].apply(x32, SIZES[1], &code, scratch);
        self.down[1].apply(x32, SIZES[1], true, false, x16);
        self.encode[1].apply(x16, SIZES[2], &code, scratch);
        self.down[2].apply(x16, SIZES[2], true, false, x8);
        self.encode[2].apply(x8, SIZES[3], &code, scratch);
        self.attention.apply(x8);
        // A map of single pixels gives the same before pixels are doubled as after it.
        let coarse = &mut scratch[..x16.len() / 4];
        self.up[0].apply(x8, SIZES[3], true, false, coarse);
        add_twice(coarse, SIZES[3], x16);
        self.decode[0].apply(x16, SIZES[2], &code, scratch);
        let coarse = &mut scratch[..x32.len() / 4];
        self.up[1].apply(x16, SIZES[2], true, false, coarse);
        add_twice(coarse, SIZES[2], x32);
        self.decode[1].apply(x32, SIZES[1], &code, scratch);
        let coarse = &mut scratch[..x64.len() / 4];
        self.up[2].apply(x32, SIZES[1], true, false, coarse);
        join_twice(coarse, x64, self.widths[0], joined);
        self.fine.apply(joined, SIZES[0], true, false, x64);
        self.out.apply(x64, SIZES[0], true, false, features);
    }
}

/// What an encoder works in.
pub struct Room {
    levels: [Vec<f32>; 4],
    scratch: Vec<f32>,
    joined: Vec<f32>,
    /// `ENTRIES` x features: a row for each depth of each pixel.
    pub features: Vec<f32>,
}

/// Bytes of a drawing and of its fields as 0..1; the pixels of a feature become channels, row by row of each image.
fn fold_images(drawing: &[u8], fields: &[u8], out: &mut [f32]) {
    assert_eq!(drawing.len(), IMAGE * IMAGE);
    assert_eq!(fields.len(), FIELDS);
    let rows = drawing.par_chunks(FOLD * IMAGE).zip(fields.par_chunks(FOLD * IMAGE * 2));
    let rows = rows.zip(out.par_chunks_mut(PLANE * CHANNELS));
    rows.for_each(|((drawing, fields), out)| fold_row(drawing, fields, out));
}

for_each_instruction_set! {
fn fold_row(drawing: &[u8], fields: &[u8], out: &mut [f32]) {
    let unit = |byte: u8| f32::from(byte) / 255.0;
    let lines = drawing.chunks_exact(IMAGE).zip(fields.chunks_exact(2 * IMAGE));
    for (line, (drawing, fields)) in lines.enumerate() {
        let pixels = drawing.as_chunks::<FOLD>().0.iter().zip(fields.as_chunks::<{ 2 * FOLD }>().0);
        for ((drawing, fields), out) in pixels.zip(out.as_chunks_mut::<CHANNELS>().0) {
            for i in 0..FOLD {
                let channel = line * FOLD + i;
                out[channel] = unit(drawing[i]);
                out[FOLD * FOLD + channel] = unit(fields[2 * i]);
                out[2 * FOLD * FOLD + channel] = unit(fields[2 * i + 1]);
            }
        }
    }
}
}

/// Channels of an image half as large, whose pixels are doubled, then those of another image.
fn join_twice(coarse: &[f32], fine: &[f32], width: usize, out: &mut [f32]) {
    let rows = out.par_chunks_mut(PLANE * 2 * width).zip(fine.par_chunks(PLANE * width));
    rows.enumerate().for_each(|(row, (out, fine))| {
        let coarse = &coarse[row / 2 * (PLANE / 2) * width..][..PLANE / 2 * width];
        for (col, out) in out.chunks_exact_mut(2 * width).enumerate() {
            out[..width].copy_from_slice(&coarse[col / 2 * width..][..width]);
            out[width..].copy_from_slice(&fine[col * width..][..width]);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sixteen_pixels_of_a_feature_become_channels() {
        let drawing: Vec<u8> = (0..IMAGE * IMAGE).map(|i| (i * 31 % 256) as u8).collect();
        let fields: Vec<u8> = (0..FIELDS).map(|i| (i * 57 % 251) as u8).collect();
        let mut out = vec![-1.0; 48 * 64 * 64];
        fold_images(&drawing, &fields, &mut out);
        for (i, got) in out.iter().enumerate() {
            let (row, col, channel) = (i / 48 / 64, i / 48 % 64, i % 48);
            let pixel = (row * 4 + channel % 16 / 4) * 256 + col * 4 + channel % 4;
            let byte = [drawing[pixel], fields[2 * pixel], fields[2 * pixel + 1]][channel / 16];
            assert_eq!(*got, f32::from(byte) / 255.0);
        }
    }

    #[test]
    fn a_smaller_image_is_doubled_and_joined_with_the_other() {
        let coarse: Vec<f32> = (0..32 * 32 * 3).map(|i| i as f32).collect();
        let fine: Vec<f32> = (0..64 * 64 * 3).map(|i| -(i as f32)).collect();
        let mut out = vec![0.5; 64 * 64 * 6];
        join_twice(&coarse, &fine, 3, &mut out);
        for (i, got) in out.iter().enumerate() {
            let (row, col, c) = (i / 6 / 64, i / 6 % 64, i % 6);
            let doubled = (row / 2 * 32 + col / 2) * 3 + c;
            assert_eq!(*got, if c < 3 { coarse[doubled] } else { fine[(row * 64 + col) * 3 + c - 3] });
        }
    }
}
