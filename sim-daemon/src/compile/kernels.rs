//! Kernels of a GPU as text.

use std::fmt::Write as _;

use sim_engine::backend::gpu::Listing;

/// A table of the kernels, then their sources if `lists`.
pub(super) fn text(listing: &Listing, lists: bool) -> String {
    let mut text = String::new();
    let head = ["kernel", "dispatches", "threads", "statements", "bytes"];
    let [kernel, dispatches, threads, statements, bytes] = head;
    let _ = writeln!(
        text,
        "{kernel:<12}{dispatches:>11}{threads:>9}{statements:>12}{bytes:>10}"
    );
    for kernel in &listing.kernels {
        let _ = writeln!(
            text,
            "{:<12}{:>11}{:>9}{:>12}{:>10}",
            kernel.label, kernel.dispatches, kernel.threads, kernel.statements, kernel.bytes
        );
    }
    let [fields, contacts, most] = [
        listing.fields_bytes,
        listing.contacts_bytes,
        listing.contacts_bytes_max,
    ]
    .map(|bytes| bytes.div_ceil(1000));
    let more = match contacts == most {
        true => String::new(),
        false => format!(", {most} kB once a world needs room for all"),
    };
    let _ = writeln!(
        text,
        "memory of a world: {fields} kB, and {contacts} kB for contacts{more}"
    );
    if lists {
        for kernel in &listing.kernels {
            let _ = writeln!(text, "\n// {}\n{}", kernel.label, kernel.wgsl);
        }
    }
    text
}
