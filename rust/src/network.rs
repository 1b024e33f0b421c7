//! The compact network on the CPU, in single precision: drawings in, occupancy of the half world grid z > 0 out. It says
//! what `CompactNet` says in Python (`nets/compact.py`), where it is trained.
//!
//! Images and volumes are cells x channels. What is linear is done where it is cheapest: before cells are doubled, and the
//! decoder's first layer in `read`, all but the share of the prior, which alone changes from round to round. What is
//! negative is cut off where the next layer reads it, and no layer writes an image that is only added to another.

mod attention;
mod block;
mod decoder;
mod dense;
mod encoder;
mod norm;
mod reading;
mod spare;
pub mod weights;
pub mod widths;

use crate::camera::{Camera, IMAGE, PACKED};
use crate::error::CoreError;
use crate::evidence::FIELDS;
use crate::lift::HALF;
use decoder::Decoder;
use encoder::Encoder;
use reading::Reading;
pub use reading::{BYTES as EVIDENCE_BYTES, VOXELS};
use spare::Spare;
use weights::Weights;
use widths::Widths;

/// The network, its weights laid out once.
pub struct CompactNetwork {
    encoder: Encoder,
    reading: Reading,
    decoder: Decoder,
    outputs: usize,
    /// What drawings are read in: an encoder's room, and what cells have read.
    readers: Spare<(encoder::Room, Vec<f32>)>,
    deciders: Spare<decoder::Room>,
}

impl CompactNetwork {
    /// # Errors
    /// If no network has these widths, or the weights are not those of one that has.
    pub fn new(mut weights: Weights<'_>, widths: &Widths) -> Result<Self, CoreError> {
        widths.check()?;
        let encoder = Encoder::of(&mut weights, widths)?;
        let each = weights.point("reading", 2 * widths.features, widths.fused, 0)?;
        let (decoder, first) = Decoder::of(&mut weights, widths)?;
        weights.finish()?;
        let reading = Reading::new(each, &first.weight, &first.bias, widths);
        let (outputs, readers, deciders) = (first.bias.len(), Spare::new(), Spare::new());
        Ok(Self { encoder, reading, decoder, outputs, readers, deciders })
    }

    /// Numbers of each cell that `read` makes and `decide` takes.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// What does not change from round to round: `HALF` x `outputs` for each object.
    ///
    /// `drawings` holds `IMAGE`^2 bytes and `fields` `FIELDS` bytes for each camera, given as packed; `counts` says how
    /// many of them each object has, and `evidence` holds `EVIDENCE_BYTES` for each.
    ///
    /// # Errors
    /// If counts do not add up, or a camera is none.
    pub fn read(
        &self,
        drawings: &[u8],
        fields: &[u8],
        cameras: &[[f64; PACKED]],
        counts: &[usize],
        evidence: &[u8],
    ) -> Result<Vec<f32>, CoreError> {
        assert_eq!(drawings.len(), cameras.len() * IMAGE * IMAGE);
        assert_eq!(fields.len(), cameras.len() * FIELDS);
        assert_eq!(evidence.len(), counts.len() * EVIDENCE_BYTES);
        check_counts(counts)?;
        if counts.iter().try_fold(0, |sum: usize, &n| sum.checked_add(n)) != Some(cameras.len()) {
            return Err(CoreError::Counts { counts: counts.to_vec(), drawings: cameras.len() });
        }
        let known: Vec<Camera> = cameras.iter().map(Camera::from_packed).collect::<Result<_, _>>()?;
        let mut out = vec![0.0; counts.len() * HALF * self.outputs];
        let objects = out.chunks_exact_mut(HALF * self.outputs).zip(evidence.chunks_exact(EVIDENCE_BYTES));
        let make = || (self.encoder.room(), self.reading.room());
        self.readers.with(make, |(room, seen)| {
            let mut next = 0;
            for (&count, (out, evidence)) in counts.iter().zip(objects) {
                for i in next..next + count {
                    let (drawing, fields) = (&drawings[i * IMAGE * IMAGE..], &fields[i * FIELDS..]);
                    let rotation = std::array::from_fn(|entry| cameras[i][3 + entry] as f32);
                    self.encoder.apply(&drawing[..IMAGE * IMAGE], &fields[..FIELDS], &rotation, room);
                    self.reading.add(&known[i], &room.features, i == next, seen);
                }
                self.reading.finish(seen, count, evidence, out);
                next += count;
            }
        });
        Ok(out)
    }

    /// Probability of occupancy of each cell's voxels, `HALF` x `VOXELS` for each object, from what was read, a prior of
    /// the same form, and the number of drawings of each object.
    ///
    /// # Errors
    /// If there is an object without drawings.
    pub fn decide(
        &self,
        readings: &[f32],
        prior: Option<&[f32]>,
        counts: &[usize],
    ) -> Result<Vec<f32>, CoreError> {
        assert_eq!(readings.len(), counts.len() * HALF * self.outputs);
        assert!(prior.is_none_or(|prior| prior.len() == counts.len() * HALF * VOXELS));
        check_counts(counts)?;
        let mut out = vec![0.0; counts.len() * HALF * VOXELS];
        let objects = out.chunks_exact_mut(HALF * VOXELS).zip(readings.chunks_exact(HALF * self.outputs));
        self.deciders.with(
            || self.decoder.room(),
            |room| {
                for (i, (&count, (out, readings))) in counts.iter().zip(objects).enumerate() {
                    let prior = prior.map(|prior| &prior[i * HALF * VOXELS..][..HALF * VOXELS]);
                    self.decoder.apply(readings, prior, count, room, out);
                }
            },
        );
        Ok(out)
    }
}

fn check_counts(counts: &[usize]) -> Result<(), CoreError> {
    match counts.iter().position(|&count| count == 0) {
        None => Ok(()),
        Some(object) => Err(CoreError::NoDrawings { object }),
    }
}
