//! Pixels in colour, and the marks that are drawn flat on them: text, lines, rectangles.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};

/// Colour of the page.
pub(super) const PAPER: Rgb = [250, 250, 251];

/// Red, green, blue.
pub(super) type Rgb = [u8; 3];

/// Height of a line of text [pixels].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Size {
    Small,
    Large,
}

impl Size {
    fn raster(self) -> (FontWeight, RasterHeight) {
        match self {
            Size::Small => (FontWeight::Regular, RasterHeight::Size16),
            Size::Large => (FontWeight::Bold, RasterHeight::Size24),
        }
    }

    /// Advance of a letter [pixels].
    pub fn advance(self) -> usize {
        let (weight, height) = self.raster();
        get_raster('m', weight, height).map_or(0, |glyph| glyph.width())
    }
}

/// An image in rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Canvas {
    /// Columns [pixels].
    pub width: usize,
    /// Rows [pixels].
    pub height: usize,
    /// Row by row.
    pub pixels: Vec<Rgb>,
}

impl Canvas {
    /// All of one colour.
    pub(super) fn new(width: usize, height: usize, colour: Rgb) -> Canvas {
        let pixels = vec![colour; width * height];
        Canvas {
            width,
            height,
            pixels,
        }
    }

    /// Lays `colour` over a pixel, `cover` of it from 0 to 1; what lies outside is passed over.
    pub(super) fn blend(&mut self, x: i64, y: i64, colour: Rgb, cover: f64) {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return;
        }
        let pixel = &mut self.pixels[y as usize * self.width + x as usize];
        *pixel = mix(*pixel, colour, cover);
    }

    /// A full rectangle.
    pub(super) fn rectangle(&mut self, x: i64, y: i64, width: i64, height: i64, colour: Rgb) {
        for row in y..y + height {
            for column in x..x + width {
                self.blend(column, row, colour, 1.0);
            }
        }
    }

    /// Another image, its upper left corner at (x, y).
    pub(super) fn paste(&mut self, x: usize, y: usize, image: &Canvas) {
        for (row, pixels) in image.pixels.chunks_exact(image.width).enumerate() {
            let start = (y + row) * self.width + x;
            self.pixels[start..start + image.width].copy_from_slice(pixels);
        }
    }

    /// Text whose box begins at (x, y); letters that the font has not become `?`.
    pub(super) fn text(&mut self, x: i64, y: i64, text: &str, size: Size, colour: Rgb) {
        let (weight, height) = size.raster();
        let mut left = x;
        for letter in text.chars() {
            let glyph =
                get_raster(letter, weight, height).or_else(|| get_raster('?', weight, height));
            for (row, line) in glyph.iter().flat_map(|glyph| glyph.rows()).enumerate() {
                for (column, &ink) in line.iter().enumerate() {
                    let cover = f64::from(ink) / 255.0;
                    self.blend(left + column as i64, y + row as i64, colour, cover);
                }
            }
            left += size.advance() as i64;
        }
    }

    /// Small text that stands out from whatever it lies on.
    pub(super) fn label(&mut self, x: i64, y: i64, text: &str, colour: Rgb) {
        for (right, down) in [
            (-1, 0),
            (1, 0),
            (0, -1),
            (0, 1),
            (-1, -1),
            (1, 1),
            (-1, 1),
            (1, -1),
        ] {
            self.text(x + right, y + down, text, Size::Small, PAPER);
        }
        self.text(x, y, text, Size::Small, colour);
    }

    /// A line with round ends between two points [pixels].
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, colour: Rgb) {
        let reach = 0.5 * width + 1.0;
        let span = |axis: usize, size: usize| {
            let low = (from[axis].min(to[axis]) - reach).max(0.0);
            let high = (from[axis].max(to[axis]) + reach).min(size as f64);
            low as i64..high as i64
        };
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        let wide = span(0, self.width);
        for y in span(1, self.height) {
            // where the line crosses this row, and how far it reaches to both sides
            let across = from[0] + (y as f64 + 0.5 - from[1]) * along[0] / along[1];
            let beside = reach * square.sqrt() / along[1].abs();
            let row = if (across - beside).is_finite() && (across + beside).is_finite() {
                wide.start.max((across - beside) as i64)..wide.end.min((across + beside) as i64 + 1)
            } else {
                wide.clone()
            };
            for x in row {
                let point = [x as f64 + 0.5 - from[0], y as f64 + 0.5 - from[1]];
                let foot = if square > 0.0 {
                    ((point[0] * along[0] + point[1] * along[1]) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let distance = (point[0] - foot * along[0]).hypot(point[1] - foot * along[1]);
                // a pixel at the rim is covered in part
                let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
                self.blend(x, y, colour, cover);
            }
        }
    }

    /// A line that ends in an arrow head.
    pub(super) fn arrow(&mut self, from: [f64; 2], to: [f64; 2], width: f64, colour: Rgb) {
        self.line(from, to, width, colour);
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        let head = (3.5 * width).min(0.5 * length);
        if length > 0.0 {
            let [x, y] = along.map(|part| part / length * head);
            for side in [-0.45, 0.45] {
                let barb = [to[0] - x - side * y, to[1] - y + side * x];
                self.line(to, barb, width, colour);
            }
        }
    }
}

/// `share` of `over`, the rest of `under`.
pub(super) fn mix(under: Rgb, over: Rgb, share: f64) -> Rgb {
    std::array::from_fn(|part| {
        let (under, over) = (f64::from(under[part]), f64::from(over[part]));
        (under + (over - under) * share).round() as u8
    })
}
