//! Random numbers that are the same on every machine: one stream for each (seed, sample, purpose).

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Streams that one sample may use: purposes 0 to 63, so far apart that none runs into the next.
const PURPOSES: u64 = 64;
const APART: u32 = 60;

/// A stream of random numbers. Uses no function of the C library, so its values are bit-identical everywhere.
pub struct Random(ChaCha8Rng);

impl Random {
    /// The stream of a seed's sample for one purpose, below 64.
    pub fn new(seed: u64, sample: u64, purpose: u64) -> Self {
        debug_assert!(purpose < PURPOSES);
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(sample);
        generator.set_word_pos(u128::from(purpose) << APART);
        Self(generator)
    }

    /// Evenly in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Evenly in [from, to).
    pub fn between(&mut self, [from, to]: [f64; 2]) -> f64 {
        from + (to - from) * self.unit()
    }

    /// Evenly in [-by, by).
    pub fn around(&mut self, by: f64) -> f64 {
        self.between([-by, by])
    }

    /// One of 0 .. n, n more than 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
}
