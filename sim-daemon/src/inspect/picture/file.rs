//! PNG files.

use std::path::Path;

use super::canvas::Canvas;
use crate::output;

/// What our files say of themselves.
const SOFTWARE: &str = "tightloop inspect";

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
