//! The caller's memory: pointers and lengths become slices, numbers are written into strided attributes.

use crate::status::{Failure, Status};
use kitsuke::glam::{Vec2, Vec3};
use std::mem::size_of;

/// Where the vectors of a vertex attribute go, 32-bit floats: alone in a buffer (`offset` 0, `stride` 12) or between other attributes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Attribute {
    /// The buffer, aligned to 4 bytes.
    pub data: *mut f32,
    /// Its length, bytes.
    pub bytes: usize,
    /// Where the first vector begins, bytes; a multiple of 4.
    pub offset: usize,
    /// Bytes from vector to vector, a multiple of 4; 0 means that they lie close together.
    pub stride: usize,
}

impl Attribute {
    /// Where to write `count` vectors of N floats: the floats, the first one's number, the step. Refuses what does not fit.
    ///
    /// # Safety
    /// `data` must be null or have room for `bytes` bytes, in nobody else's use for as long as the slice lives.
    unsafe fn floats<'a, const N: usize>(
        self,
        what: &str,
        count: usize,
    ) -> Result<(&'a mut [f32], usize, usize), Failure> {
        const FLOAT: usize = size_of::<f32>();
        let Attribute { data, bytes, offset, stride } = self;
        let stride = if stride == 0 { N * FLOAT } else { stride };
        let end = count.checked_sub(1).map_or(Some(offset), |last| {
            last.checked_mul(stride).and_then(|at| at.checked_add(offset)).and_then(|at| at.checked_add(N * FLOAT))
        });
        let (is_aligned, is_long) = (
            (data as usize).is_multiple_of(FLOAT) && (offset | stride).is_multiple_of(FLOAT) && stride >= N * FLOAT,
            end.is_some_and(|end| end <= bytes),
        );
        match () {
            () if data.is_null() => Err((Status::Null, format!("the buffer of {what} is null"))),
            () if !is_aligned => Err((
                Status::Buffer,
                format!(
                    "{what}: buffer, offset {offset} and stride {stride} must be multiples of {FLOAT}, the stride at least {}",
                    N * FLOAT
                ),
            )),
            () if !is_long => Err((
                Status::Buffer,
                format!("{what}: {count} vectors at offset {offset} and stride {stride} do not fit into {bytes} bytes"),
            )),
            () => {
                // SAFETY: `data` is not null, aligned, and has room for `bytes` bytes, as the caller promises.
                let floats = unsafe { std::slice::from_raw_parts_mut(data, bytes / FLOAT) };
                Ok((floats, offset / FLOAT, stride / FLOAT))
            }
        }
    }

    /// The vectors as a slice of the buffer, where they lie close together.
    ///
    /// # Safety
    /// As [`Attribute::floats`].
    pub(crate) unsafe fn slice<'a>(self, what: &str, count: usize) -> Result<Option<&'a mut [Vec3]>, Failure> {
        // SAFETY: the caller promises the same.
        let (floats, first, step) = unsafe { self.floats::<3>(what, count) }?;
        Ok((step == 3).then(|| bytemuck::cast_slice_mut(&mut floats[first..first + 3 * count])))
    }

    /// Writes vectors, each changed on the way.
    ///
    /// # Safety
    /// As [`Attribute::floats`].
    pub(crate) unsafe fn write(self, what: &str, from: &[Vec3], change: impl Fn(Vec3) -> Vec3) -> Result<(), Failure> {
        // SAFETY: the caller promises the same.
        let (floats, first, step) = unsafe { self.floats::<3>(what, from.len()) }?;
        for (to, &vector) in floats[first..].chunks_mut(step).zip(from) {
            to[..3].copy_from_slice(&change(vector).to_array());
        }
        Ok(())
    }

    /// The same of two floats each.
    ///
    /// # Safety
    /// As [`Attribute::floats`].
    pub(crate) unsafe fn write_uv(
        self,
        what: &str,
        from: &[Vec2],
        change: impl Fn(Vec2) -> Vec2,
    ) -> Result<(), Failure> {
        // SAFETY: the caller promises the same.
        let (floats, first, step) = unsafe { self.floats::<2>(what, from.len()) }?;
        for (to, &vector) in floats[first..].chunks_mut(step).zip(from) {
            to[..2].copy_from_slice(&change(vector).to_array());
        }
        Ok(())
    }
}

/// A slice of the caller's; null only where it is empty.
///
/// # Safety
/// `data` must be null or point to `length` values that nobody changes for as long as the slice lives.
pub(crate) unsafe fn slice<'a, T>(what: &str, data: *const T, length: usize) -> Result<&'a [T], Failure> {
    match (data.is_null(), length) {
        (_, 0) => Ok(&[]),
        (true, _) => Err((Status::Null, format!("{what} is null"))),
        // SAFETY: not null; the rest is the caller's promise.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(data, length) }),
    }
}

/// A buffer of the caller's that must hold at least `needed` values.
///
/// # Safety
/// `data` must be null or have room for `length` values, in nobody else's use for as long as the slice lives.
pub(crate) unsafe fn room<'a, T>(
    what: &str,
    data: *mut T,
    length: usize,
    needed: usize,
) -> Result<&'a mut [T], Failure> {
    match data.is_null() {
        _ if needed == 0 => Ok(&mut []),
        true => Err((Status::Null, format!("the buffer of {what} is null"))),
        false if length < needed => {
            Err((Status::Buffer, format!("the buffer of {what} has room for {length}; {needed} are needed")))
        }
        // SAFETY: not null and long enough; the rest is the caller's promise.
        false => Ok(unsafe { std::slice::from_raw_parts_mut(data, needed) }),
    }
}

/// What a pointer of the caller's points to.
///
/// # Safety
/// `pointer` must be null or valid, and nobody may change it for as long as the reference lives.
pub(crate) unsafe fn given<'a, T>(what: &str, pointer: *const T) -> Result<&'a T, Failure> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| (Status::Null, format!("{what} is null")))
}

/// The same to be changed.
///
/// # Safety
/// `pointer` must be null or valid, and nobody else may use it for as long as the reference lives.
pub(crate) unsafe fn given_mut<'a, T>(what: &str, pointer: *mut T) -> Result<&'a mut T, Failure> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| (Status::Null, format!("{what} is null")))
}

/// Writes into a place of the caller's, which need not hold anything yet.
///
/// # Safety
/// `to` must be null or have room for a value.
pub(crate) unsafe fn put<T>(what: &str, to: *mut T, value: T) -> Result<(), Failure> {
    if to.is_null() {
        return Err((Status::Null, format!("the place of {what} is null")));
    }
    // SAFETY: not null, and the caller promises room.
    unsafe { to.write(value) };
    Ok(())
}

/// Writes a new handle into the place of the caller's.
///
/// # Safety
/// As [`put`].
pub(crate) unsafe fn put_handle<T>(
    what: &str,
    to: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> Result<(), Failure> {
    // SAFETY: the caller promises room. The place is set in any case, so that what is freed after a failure is null.
    unsafe { put(what, to, std::ptr::null_mut()) }?;
    let handle = Box::into_raw(Box::new(make()?));
    // SAFETY: as above.
    unsafe { put(what, to, handle) }
}

/// Frees a handle.
///
/// # Safety
/// `handle` must be null or come from [`put_handle`] and not have been freed.
pub(crate) unsafe fn free<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: the caller's promise.
        drop(unsafe { Box::from_raw(handle) });
    }
}

/// Writes text, NUL-terminated and cut off where the room ends (never within a character); returns its whole length, bytes.
///
/// # Safety
/// `buffer` must be null or have room for `capacity` bytes.
pub(crate) unsafe fn write_text(text: &str, buffer: *mut u8, capacity: usize) -> usize {
    if !buffer.is_null() && capacity > 0 {
        let mut kept = text.len().min(capacity - 1);
        while !text.is_char_boundary(kept) {
            kept -= 1;
        }
        // SAFETY: there is room for `capacity` bytes, which are more than `kept`.
        let room = unsafe { std::slice::from_raw_parts_mut(buffer, kept + 1) };
        room[..kept].copy_from_slice(&text.as_bytes()[..kept]);
        room[kept] = 0;
    }
    text.len()
}

/// The first `struct_size` bytes of a struct whose first field that is, so that callers of an earlier version get what they know.
///
/// # Safety
/// `to` must be null or point to a struct of at least as many bytes as its first field says, a `u32`.
pub(crate) unsafe fn put_struct<T: bytemuck::NoUninit>(what: &str, to: *mut T, value: &T) -> Result<(), Failure> {
    const FIRST: usize = size_of::<u32>();
    // SAFETY: the caller promises at least the first field.
    let size = unsafe { *given(what, to.cast::<u32>().cast_const())? } as usize;
    if size < FIRST {
        return Err((Status::Buffer, format!("struct_size of {what} is not set")));
    }
    let bytes = bytemuck::bytes_of(value);
    let kept = size.min(bytes.len());
    // SAFETY: the struct of the caller's has `size` bytes.
    let room = unsafe { std::slice::from_raw_parts_mut(to.cast::<u8>(), kept) };
    room[FIRST..].copy_from_slice(&bytes[FIRST..kept]);
    Ok(())
}

/// Memory for hosts that have no allocator of their own (WebAssembly): `length` bytes, aligned to 16, all 0; null when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn kitsuke_bytes_new(length: usize) -> *mut u8 {
    match std::alloc::Layout::from_size_align(length.max(1), 16) {
        // SAFETY: the layout is not empty.
        Ok(layout) => unsafe { std::alloc::alloc_zeroed(layout) },
        Err(_) => std::ptr::null_mut(),
    }
}

/// Frees memory of [`kitsuke_bytes_new`].
///
/// # Safety
/// `bytes` must be null or come from [`kitsuke_bytes_new`] with this `length`, and not have been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_bytes_free(bytes: *mut u8, length: usize) {
    if let (false, Ok(layout)) = (bytes.is_null(), std::alloc::Layout::from_size_align(length.max(1), 16)) {
        // SAFETY: made with the same layout, as the caller promises.
        unsafe { std::alloc::dealloc(bytes, layout) };
    }
}
