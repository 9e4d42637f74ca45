//! The allocator, and how it gives memory back.

use std::hint::black_box;
use std::thread;
use std::time::Duration;

use mimalloc::MiMalloc;

#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

/// Longer than mimalloc keeps freed pages, which is a second.
const PAUSE: Duration = Duration::from_secs(2);
/// Sizes with pages of their own kind each.
const SIZES: [usize; 3] = [64 << 10, 512 << 10, 4 << 20];
/// In each of these rounds a part of the arenas is looked at.
const ROUNDS: usize = 4;

/// Has memory given back to the system while the process is idle: what `release` frees, given how long it must have been unused, and what was
/// freed before. mimalloc gives pages back when some thread frees a page later, and in an idle service no thread does: after a large scan it would
/// keep its memory until the next one.
///
/// Without a thread for it, memory is given back with the next requests.
pub fn give_back_when_idle(release: impl Fn(Duration) + Send + 'static) {
    let give_back = move || {
        loop {
            thread::sleep(PAUSE);
            release(PAUSE);
            for size in [SIZES; ROUNDS].into_iter().flatten() {
                drop(black_box(Vec::<u8>::with_capacity(size)));
            }
        }
    };
    let named = thread::Builder::new().name("give-back".to_owned());
    // Detached: it ends with the process.
    named.spawn(give_back).ok();
}
