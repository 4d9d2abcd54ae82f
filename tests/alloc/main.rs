//! Tests of memory use, under a global allocator that counts per thread.

mod frame;
mod live;
mod open;
mod texture;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// What a piece of code took from the allocator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Usage {
    /// How often it allocated or grew something.
    allocations: usize,
    /// The most bytes that it held at once.
    peak_bytes: isize,
}

thread_local! {
    static LIVE_BYTES: Cell<isize> = const { Cell::new(0) };
    static USAGE: Cell<Usage> = const { Cell::new(Usage { allocations: 0, peak_bytes: 0 }) };
}

/// Runs something and says what this thread allocated meanwhile.
fn usage<T>(run: impl FnOnce() -> T) -> (T, Usage) {
    LIVE_BYTES.set(0);
    USAGE.set(Usage::default());
    let result = run();
    (result, USAGE.get())
}

/// The system's allocator, counting.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// SAFETY: every call goes on to the system's allocator unchanged. Counting touches only `Cell`s of plain numbers, which
// neither allocate nor have destructors. Growing takes the trait's way over `alloc`, so that old and new are counted.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LIVE_BYTES.set(LIVE_BYTES.get() + layout.size() as isize);
        let Usage { allocations, peak_bytes } = USAGE.get();
        USAGE.set(Usage { allocations: allocations + 1, peak_bytes: peak_bytes.max(LIVE_BYTES.get()) });
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE_BYTES.set(LIVE_BYTES.get() - layout.size() as isize);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[test]
fn the_allocator_counts() {
    let (_, usage) = usage(|| {
        drop(std::hint::black_box(vec![0u8; 1000]));
        std::hint::black_box(vec![0u8; 300]).len()
    });
    assert_eq!(usage, Usage { allocations: 2, peak_bytes: 1000 });
}
