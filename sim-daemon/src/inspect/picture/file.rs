//! PNG files.

use std::io::Read as _;
use std::path::Path;

use sim_model::files;

use super::canvas::Canvas;
use crate::output;

/// What our files say of themselves.
const SOFTWARE: &str = "tightloop inspect";
/// Where it is said: within so many bytes of the start.
const HEAD: u64 = 512;

/// Whether a file is a picture of ours, which may be written anew.
pub(crate) fn is_ours(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = files::open(path).map(|file| file.take(HEAD).read_to_end(&mut head));
    matches!(read, Ok(Ok(_))) && contains(&head, b"\x89PNG") && contains(&head, SOFTWARE.as_bytes())
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// Writes an image as PNG.
///
/// # Errors
/// What the system says.
pub(crate) fn write(canvas: &Canvas, path: &Path) -> std::io::Result<()> {
    let bytes = encode(canvas).map_err(std::io::Error::other)?;
    output::write(path, &bytes)
}

fn encode(canvas: &Canvas) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, canvas.width as u32, canvas.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.add_text_chunk("Software".to_owned(), SOFTWARE.to_owned())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(canvas.pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}
