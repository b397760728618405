//! A fork-join pool whose workers spin between the short parallel regions of one step.
//!
//! A step is about ten regions of a fraction of a millisecond; waking a sleeping thread for each
//! costs 8-10 % of the step. A worker that hears nothing for about a millisecond goes to sleep, so
//! an idle engine costs nothing.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;

/// Spins, about 10 us, before a waiting thread offers its core: when other programs want the cores
/// too, the thread that we wait for may be waiting for ours.
const SPINS_BEFORE_YIELD: u32 = 400;
/// Spins and yields before a worker parks; about 1 ms on an idle machine.
const TRIES_BEFORE_PARK: u32 = 4_000;

/// One turn of waiting.
#[inline]
fn wait_a_little(tries: &mut u32) {
    *tries += 1;
    if *tries < SPINS_BEFORE_YIELD { std::hint::spin_loop() } else { std::thread::yield_now() }
}

struct Shared {
    /// Number of the current region; workers wait for it to change.
    region: AtomicUsize,
    /// The region's closure as two words; valid while `unfinished` is above zero.
    job: [AtomicUsize; 2],
    next_item: AtomicUsize,
    items: AtomicUsize,
    unfinished: AtomicUsize,
    stop: AtomicBool,
    panicked: AtomicBool,
    parked: Vec<AtomicBool>,
}

/// `threads - 1` workers; the caller is the last thread.
pub struct Pool {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
}

impl Pool {
    /// `threads` counts the caller; 0 counts as 1.
    pub fn new(threads: usize) -> Self {
        let extra = threads.max(1) - 1;
        let shared = Arc::new(Shared {
            region: AtomicUsize::new(0),
            job: [AtomicUsize::new(0), AtomicUsize::new(0)],
            next_item: AtomicUsize::new(0),
            items: AtomicUsize::new(0),
            unfinished: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
            parked: (0..extra).map(|_| AtomicBool::new(false)).collect(),
        });
        let workers = (0..extra)
            .map(|index| {
                let shared = Arc::clone(&shared);
                std::thread::spawn(move || work(&shared, index))
            })
            .collect();
        Self { shared, workers }
    }

    /// How many threads there are, the caller included.
    pub fn threads(&self) -> usize {
        self.workers.len() + 1
    }

    /// Calls `f(i)` once for every i in 0..items, on any thread, in any order. What `f` computes
    /// must not depend on either.
    pub fn run(&mut self, items: usize, f: impl Fn(usize) + Sync) {
        if self.workers.is_empty() || items < 2 {
            (0..items).for_each(f);
            return;
        }
        let s = &*self.shared;
        let job: &(dyn Fn(usize) + Sync) = &f;
        // Sound because this function does not return, or unwind, before every worker has left the
        // region.
        let words: [usize; 2] = unsafe { std::mem::transmute(job) };
        s.job[0].store(words[0], Ordering::Relaxed);
        s.job[1].store(words[1], Ordering::Relaxed);
        s.items.store(items, Ordering::Relaxed);
        s.next_item.store(0, Ordering::Relaxed);
        s.unfinished.store(self.workers.len(), Ordering::Relaxed);
        s.region.fetch_add(1, Ordering::SeqCst);
        for (worker, parked) in self.workers.iter().zip(&s.parked) {
            if parked.load(Ordering::SeqCst) {
                worker.thread().unpark();
            }
        }
        let mine = catch_unwind(AssertUnwindSafe(|| take_items(s, job)));
        let mut tries = 0;
        while s.unfinished.load(Ordering::Acquire) > 0 {
            wait_a_little(&mut tries);
        }
        if let Err(panic) = mine {
            std::panic::resume_unwind(panic);
        }
        assert!(!s.panicked.swap(false, Ordering::Relaxed), "a worker of the splat engine panicked");
    }
}

fn take_items(s: &Shared, job: &(dyn Fn(usize) + Sync)) {
    let items = s.items.load(Ordering::Relaxed);
    loop {
        let i = s.next_item.fetch_add(1, Ordering::Relaxed);
        if i >= items {
            break;
        }
        job(i);
    }
}

fn work(s: &Shared, index: usize) {
    let mut seen = 0;
    loop {
        let mut tries = 0;
        while s.region.load(Ordering::Acquire) == seen {
            if tries < TRIES_BEFORE_PARK {
                wait_a_little(&mut tries);
                continue;
            }
            // The caller reads `parked` after it changed `region`, we read `region` after we set
            // `parked`: one of the two sees the other (both sequentially consistent), so no wake-up
            // is lost.
            s.parked[index].store(true, Ordering::SeqCst);
            if s.region.load(Ordering::SeqCst) == seen {
                std::thread::park();
            }
            s.parked[index].store(false, Ordering::SeqCst);
        }
        seen += 1;
        if s.stop.load(Ordering::Acquire) {
            return;
        }
        let words = [s.job[0].load(Ordering::Relaxed), s.job[1].load(Ordering::Relaxed)];
        let job: &(dyn Fn(usize) + Sync) = unsafe { std::mem::transmute(words) };
        if catch_unwind(AssertUnwindSafe(|| take_items(s, job))).is_err() {
            s.panicked.store(true, Ordering::Relaxed);
        }
        s.unfinished.fetch_sub(1, Ordering::Release);
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        self.shared.region.fetch_add(1, Ordering::SeqCst);
        for worker in self.workers.drain(..) {
            worker.thread().unpark();
            // A worker never panics outside `catch_unwind`.
            let _ = worker.join();
        }
    }
}

/// A slice that several threads write, each its own elements.
pub(crate) struct Shards<'a, T> {
    data: *mut T,
    len: usize,
    life: std::marker::PhantomData<&'a mut [T]>,
}

unsafe impl<T: Send> Sync for Shards<'_, T> {}

impl<'a, T> Shards<'a, T> {
    pub fn new(slice: &'a mut [T]) -> Self {
        Self { data: slice.as_mut_ptr(), len: slice.len(), life: std::marker::PhantomData }
    }

    /// # Safety
    /// No other live reference overlaps `start..start + len`.
    #[allow(clippy::mut_from_ref)]
    #[inline(always)]
    pub unsafe fn slice(&self, start: usize, len: usize) -> &mut [T] {
        assert!(start + len <= self.len);
        unsafe { std::slice::from_raw_parts_mut(self.data.add(start), len) }
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Pointer to the first element, for kernels that index on their own.
    #[inline(always)]
    pub fn ptr(&self) -> *mut T {
        self.data
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_runs_once_and_the_pool_survives_sleep_and_panic() {
        let mut pool = Pool::new(3);
        for round in 0..200 {
            let hits: Vec<AtomicUsize> = (0..50).map(|_| AtomicUsize::new(0)).collect();
            pool.run(50, |i| {
                hits[i].fetch_add(1, Ordering::Relaxed);
            });
            assert!(hits.iter().all(|h| h.load(Ordering::Relaxed) == 1));
            if round % 50 == 0 {
                std::thread::sleep(std::time::Duration::from_millis(3));
            }
        }
        let failed = catch_unwind(AssertUnwindSafe(|| pool.run(50, |i| assert!(i != 20))));
        assert!(failed.is_err());
        pool.run(4, |_| ());
    }
}
