//! Status codes, the message behind them, and the guard that no panic passes.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What became of a call.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All went well.
    Ok = 0,
    /// A pointer is null that must not be.
    Null = 1,
    /// A buffer is too short, or its offset or stride is no multiple of 4.
    Buffer = 2,
    /// A number names nothing: a vertex, frame, bone, text …
    Range = 3,
    /// A pack cannot be opened.
    Pack = 4,
    /// A recorded motion cannot be read.
    Motion = 5,
    /// A kimono cannot be fitted.
    Fit = 6,
    /// A bug of kitsuke; the handle that was used is to be freed.
    Panic = 7,
}

/// A status that is not [`Status::Ok`] and what to say of it.
pub(crate) type Failure = (Status, String);

thread_local! {
    static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Copies what the last call of this thread had to say, NUL-terminated and cut off after `capacity - 1` bytes, and returns its whole
/// length in bytes without the NUL. Empty after a call without anything to say. `buffer` may be null when `capacity` is 0.
///
/// # Safety
/// `buffer` must have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_message(buffer: *mut u8, capacity: usize) -> usize {
    MESSAGE.with_borrow(|message| {
        // SAFETY: as the caller promises.
        unsafe { super::buffer::write_text(message, buffer, capacity) }
    })
}

pub(crate) fn set_message(text: impl Into<String>) {
    MESSAGE.set(text.into());
}

/// Runs a function of the interface.
pub(crate) fn guarded(run: impl FnOnce() -> Result<(), Failure>) -> Status {
    MESSAGE.with_borrow_mut(String::clear);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err((status, message))) => {
            set_message(message);
            status
        }
        Err(panic) => {
            let said = panic.downcast_ref::<String>().map(String::as_str);
            let said = said.or(panic.downcast_ref::<&str>().copied()).unwrap_or("without a message");
            set_message(format!("a bug of kitsuke: {said}"));
            Status::Panic
        }
    }
}
