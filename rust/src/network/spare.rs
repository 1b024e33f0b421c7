//! Memory that one call leaves for the next: pages that are new must be cleared first, which takes as long as a layer.

use std::sync::{Mutex, PoisonError};

/// As many as calls have needed at once.
pub struct Spare<T>(Mutex<Vec<T>>);

impl<T> Spare<T> {
    pub fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// Calls `use_it` with one that nobody uses, or a new one. It is as the last call left it.
    pub fn with<R>(&self, make: impl FnOnce() -> T, use_it: impl FnOnce(&mut T) -> R) -> R {
        let spares = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let spare = spares().pop();
        let mut taken = spare.unwrap_or_else(make);
        let result = use_it(&mut taken);
        spares().push(taken);
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_at_once_have_one_each_and_later_ones_take_them_over() {
        let spare = Spare::new();
        let make = || -> Vec<u8> { vec![] };
        spare.with(make, |a| {
            spare.with(make, |b| b.push(2));
            a.push(1);
        });
        spare.with(make, |last| assert_eq!(*last, [1]));
        assert_eq!(spare.0.into_inner().unwrap().len(), 2);
    }
}
