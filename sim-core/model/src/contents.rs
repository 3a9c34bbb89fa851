//! What a file holds, by its first bytes: files are renamed, fetched as web pages, or pointers to files that were not fetched.

/// Bytes that are looked at.
const SAMPLE: usize = 4096;

/// What a page of a site that should have been a file is.
pub(crate) const WEB_PAGE: &str = "this is a web page, not the file; download the raw file";

/// What the bytes of a file hold that is no robot and no mesh, with the cure; `None` where they may be one.
pub(crate) fn neither_robot_nor_mesh(bytes: &[u8]) -> Option<&'static str> {
    const SIGNATURES: [(&[u8], &str); 9] = [
        (
            b"version https://git-lfs",
            "this is a pointer to a file in Git LFS, not the file; run `git lfs pull`",
        ),
        (b"\x1f\x8b", "this is compressed by gzip; unpack it first"),
        (b"PK\x03\x04", "this is a ZIP archive; unpack it first"),
        (
            b"7z\xbc\xaf\x27\x1c",
            "this is a 7z archive; unpack it first",
        ),
        (b"\x89PNG", "this is a picture; give another file"),
        (b"\x7fELF", "this is a program; give another file"),
        (b"%PDF", "this is a PDF document; give another file"),
        (b"\x93NUMPY", "this is a NumPy array; give another file"),
        (
            b"PXR-USDC",
            "this is USD; export it in a format that is read",
        ),
    ];
    let start = start(bytes);
    let signature = SIGNATURES
        .iter()
        .find(|(signature, _)| start.starts_with(signature));
    if let Some((_, what)) = signature {
        return Some(what);
    }
    let doctype = b"<!doctype html";
    start
        .get(..doctype.len())
        .is_some_and(|word| word.eq_ignore_ascii_case(doctype))
        .then_some(WEB_PAGE)
}

/// The format of a mesh in the bytes of a file, and how such a file's name ends.
pub(crate) fn mesh_format(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let text = start(bytes);
    let text = &text[..text.len().min(SAMPLE)];
    let has = |word: &[u8]| text.windows(word.len()).any(|part| part == word);
    let triangles = bytes.get(80..84).and_then(|count| count.try_into().ok());
    let triangles = triangles.map(|count| u32::from_le_bytes(count) as usize);
    if text.starts_with(b"glTF") {
        Some(("binary glTF", ".glb"))
    } else if text.starts_with(b"{") && has(b"\"asset\"") {
        Some(("glTF", ".gltf"))
    } else if text.starts_with(b"<") && has(b"<COLLADA") {
        Some(("COLLADA", ".dae"))
    } else if triangles.is_some_and(|count| count > 0 && bytes.len() == 84 + 50 * count)
        || text.starts_with(b"solid") && has(b"facet")
    {
        Some(("STL", ".stl"))
    } else if text.starts_with(b"ply\n") || text.starts_with(b"ply\r") {
        Some(("PLY", ".ply"))
    } else if text.starts_with(b"Kaydara FBX") {
        Some(("FBX", ".fbx"))
    } else if !text.contains(&0) && has(b"\nv ") && (has(b"\nf ") || text.len() == SAMPLE) {
        Some(("Wavefront OBJ", ".obj"))
    } else {
        None
    }
}

/// The bytes after a byte order mark and blanks.
fn start(bytes: &[u8]) -> &[u8] {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.trim_ascii_start()
}
