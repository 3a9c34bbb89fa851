//! What C passes, checked as far as a pointer can be: for NULL, alignment, length and UTF-8.

use std::ffi::{CStr, c_char};

use crate::status::{Failure, Status};

fn bad(name: &str, problem: &str, cure: &str) -> Failure {
    Failure::new(Status::BadArgument, format!("{name}: {problem}; {cure}"))
}

fn null(name: &str, cure: &str) -> Failure {
    bad(name, "it is NULL", cure)
}

/// The object behind a handle.
///
/// # Safety
/// The pointer is NULL, or one that this library made of a handle: those are never freed.
pub(crate) unsafe fn handle<H>(pointer: *const H, name: &str) -> Result<&'static H, Failure> {
    let cure = "pass what tl_attach, or the call that made the frame, has stored";
    if !pointer.is_aligned() {
        return Err(bad(name, "it is no pointer of this library", cure));
    }
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name, cure))
}

/// A text of C.
///
/// # Safety
/// The pointer is NULL, or a text that ends with a NUL byte and stays as it is during the call.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    let cure = "pass a text in UTF-8";
    if pointer.is_null() {
        return Err(null(name, cure));
    }
    // SAFETY: the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| bad(name, "not UTF-8", cure))
}

/// An array of C; NULL is one without entries.
///
/// # Safety
/// The pointer is NULL, or has `count` entries of any bits, which stay as they are during the call.
pub(crate) unsafe fn entries<'a, T: Plain>(
    pointer: *const T,
    count: usize,
    name: &str,
) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(null(
            name,
            &format!("pass {count} entries, or a count of 0"),
        ));
    }
    if !pointer.is_aligned() {
        let cure = "pass the address of an array of this type";
        return Err(bad(name, "it is misaligned", cure));
    }
    if count > isize::MAX as usize / size_of::<T>() {
        let problem = format!("{count} entries are more than memory can have");
        return Err(bad(name, &problem, "pass the number of entries"));
    }
    // SAFETY: aligned, not NULL, of a length that can be, and the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// A struct of C, or none.
///
/// # Safety
/// The pointer is NULL, or a struct that was filled in and stays as it is during the call.
pub(crate) unsafe fn optional<'a, T: Plain>(
    pointer: *const T,
    name: &str,
) -> Result<Option<&'a T>, Failure> {
    // SAFETY: the caller's promise.
    let entries = unsafe { entries(pointer, usize::from(!pointer.is_null()), name) }?;
    Ok(entries.first())
}

/// Types of which any bits are a value.
pub(crate) trait Plain {}
impl Plain for f32 {}
impl Plain for f64 {}
impl Plain for u64 {}
impl Plain for u8 {}

/// Where a result goes.
pub(crate) struct Output<T>(*mut T);

impl<T> Output<T> {
    /// A place for a result, which is set to `empty` at once.
    ///
    /// # Safety
    /// The pointer is NULL, or may be written to during the call.
    pub(crate) unsafe fn new(pointer: *mut T, empty: T, name: &str) -> Result<Output<T>, Failure> {
        let cure = "pass the address of a variable";
        if pointer.is_null() {
            return Err(null(name, cure));
        }
        if !pointer.is_aligned() {
            return Err(bad(name, "it is misaligned", cure));
        }
        let output = Output(pointer);
        output.put(empty);
        Ok(output)
    }

    fn put(&self, value: T) {
        // SAFETY: not NULL, aligned, and writable by the promise of `new`. What was there may be uninitialised.
        unsafe { self.0.write(value) }
    }

    pub(crate) fn set(self, value: T) {
        self.put(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ptr;

    #[test]
    fn null_misaligned_and_endless_arrays_are_refused_by_name() {
        let values = [0f64; 3];
        let odd = values.as_ptr().wrapping_byte_add(1);
        for (pointer, count, problem) in [
            (ptr::null(), 3, "NULL"),
            (odd, 1, "misaligned"),
            (values.as_ptr(), usize::MAX / 4, "more than memory"),
        ] {
            // SAFETY: each is refused before it is read.
            let refused = unsafe { entries(pointer, count, "values") }.unwrap_err();
            assert_eq!(refused.status, Status::BadArgument);
            assert!(refused.sentence.starts_with("values: "), "{refused:?}");
            assert!(refused.sentence.contains(problem), "{refused:?}");
        }
        // SAFETY: no entry is read of the first, and the second is an array.
        let read = unsafe { [entries(ptr::null(), 0, ""), entries(values.as_ptr(), 3, "")] };
        assert_eq!(read.map(|read| read.unwrap().len()), [0, 3]);
    }

    #[test]
    fn texts_are_utf8() {
        // SAFETY: texts with an end.
        unsafe {
            assert_eq!(text(c"joint_q".as_ptr(), "field").unwrap(), "joint_q");
            let refused = text(c"\xff".as_ptr(), "field").unwrap_err();
            assert_eq!(refused.sentence, "field: not UTF-8; pass a text in UTF-8");
        }
    }
}
