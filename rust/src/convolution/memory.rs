//! Floats that start at a cache line: vectors that straddle two cost twice as much to read.

use std::cell::Cell;
use std::ops::{Deref, DerefMut};

/// Floats in a cache line.
const LINE: usize = 16;

/// A slice whose first float is the first of a cache line.
#[derive(Default)]
pub(super) struct Aligned {
    storage: Vec<f32>,
    start: usize,
    length: usize,
}

impl Aligned {
    pub fn zeros(length: usize) -> Self {
        let storage = vec![0.0; length + LINE];
        let start = storage.as_ptr().align_offset(LINE * size_of::<f32>()).min(LINE);
        Self { storage, start, length }
    }
}

impl Deref for Aligned {
    type Target = [f32];
    fn deref(&self) -> &[f32] {
        &self.storage[self.start..][..self.length]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.storage[self.start..][..self.length]
    }
}

thread_local! {
    /// Memory that this thread has used and will use again.
    static SPARE: Cell<Vec<Aligned>> = const { Cell::new(Vec::new()) };
}

/// Calls `use_it` with that many floats of any value: those of the last call of this thread, where there are enough.
pub(super) fn with_scratch<R>(length: usize, use_it: impl FnOnce(&mut [f32]) -> R) -> R {
    // Taken, not borrowed: while this thread waits for others, it may be given another task that wants memory.
    let mut spares = SPARE.take();
    let mut memory = spares.pop().unwrap_or_default();
    SPARE.set(spares);
    if memory.len() < length {
        memory = Aligned::zeros(length);
    }
    let result = use_it(&mut memory[..length]);
    let mut spares = SPARE.take();
    spares.push(memory);
    SPARE.set(spares);
    result
}
