//! Missing pages of mapped files: Windows lets nobody cut a file that is mapped.

/// Takes note of a missing page at an address, and says whether zeros may replace it.
pub type OnMissingPage = fn(usize) -> bool;

/// Replaces pages that are missing, of which there are none here.
///
/// # Safety
/// None is needed here.
pub unsafe fn replace_missing_pages(_on_missing_page: OnMissingPage) {}
