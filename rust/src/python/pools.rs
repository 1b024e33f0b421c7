//! Threads that wait between calls: starting them anew for each would cost as much as a small sample.

use crate::error::CoreError;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

static POOLS: Mutex<BTreeMap<usize, Arc<ThreadPool>>> = Mutex::new(BTreeMap::new());

/// A pool of as many threads. It stays for the next call, unless it has more threads than the machine has cores.
pub fn pool(threads: usize) -> Result<Arc<ThreadPool>, CoreError> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = pools.get(&threads) {
        return Ok(pool.clone());
    }
    let built = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = Arc::new(built.map_err(|e| CoreError::Threads { threads, reason: e.to_string() })?);
    if threads <= std::thread::available_parallelism().map_or(1, usize::from) {
        pools.insert(threads, pool.clone());
    }
    Ok(pool)
}
