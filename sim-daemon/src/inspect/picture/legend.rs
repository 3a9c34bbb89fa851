//! What the colours mean: a palette, and the strip that names the links.

use super::Drawing;
use super::canvas::{Canvas, Rgb, Size, mix};

/// Height of a line [pixels].
const LINE: usize = 22;
/// Most entries in three columns; more are set in four.
const WIDE: usize = 27;
/// Most lines: the strip then takes a third of the page.
const LINES: usize = 15;

pub(super) const TEXT: Rgb = [32, 36, 44];
pub(super) const QUIET: Rgb = [112, 118, 130];
pub(super) const RULE: Rgb = [208, 211, 217];
pub(super) const BONE: Rgb = [150, 156, 168];

/// The colours of the links by name.
pub(super) struct Legend<'a> {
    /// Width of the strip [pixels].
    width: usize,
    entries: Vec<(&'a str, Rgb)>,
    /// What there is to say beside.
    rest: Option<String>,
}

impl<'a> Legend<'a> {
    pub fn new(drawing: &'a Drawing, width: usize) -> Legend<'a> {
        let colours = colours(drawing);
        let mut entries: Vec<(&str, Rgb)> = shown(drawing)
            .into_iter()
            .map(|link| (drawing.links[link].as_str(), colours[link]))
            .collect();
        let most = LINES * columns(entries.len());
        let rest = if entries.is_empty() {
            Some("no collision shapes: link frames, x red, y green, z blue".to_owned())
        } else if entries.len() > most {
            let rest = entries.len() - (most - 1);
            entries.truncate(most - 1);
            Some(format!("and {rest} more links"))
        } else {
            None
        };
        Legend {
            width,
            entries,
            rest,
        }
    }

    fn cells(&self) -> usize {
        self.entries.len() + usize::from(self.rest.is_some())
    }

    fn lines(&self) -> usize {
        self.cells().div_ceil(columns(self.cells())).max(1)
    }

    /// Height of the strip [pixels].
    pub fn height(&self) -> usize {
        self.lines() * LINE + 28
    }

    /// Draws the strip from this row down.
    pub fn draw(&self, page: &mut Canvas, top: i64) {
        page.rectangle(0, top, self.width as i64, 1, RULE);
        let lines = self.lines();
        let column = (self.width - 48) / columns(self.cells());
        let place = |index: usize| {
            let x = 24 + (index / lines * column) as i64;
            (x, top + 14 + (index % lines * LINE) as i64)
        };
        for (index, (name, colour)) in self.entries.iter().enumerate() {
            let (x, y) = place(index);
            page.rectangle(x, y + 2, 14, 14, *colour);
            page.text(x + 22, y, &clipped(name, column), Size::Small, TEXT);
        }
        if let Some(rest) = &self.rest {
            let (x, y) = place(self.entries.len());
            page.text(x, y, rest, Size::Small, QUIET);
        }
    }
}

/// In how many columns so many entries are set.
fn columns(entries: usize) -> usize {
    if entries > WIDE { 4 } else { 3 }
}

/// A colour a link, in body order; grey for those without shapes.
pub(super) fn colours(drawing: &Drawing) -> Vec<Rgb> {
    let shown = shown(drawing);
    let mut colours = vec![BONE; drawing.links.len()];
    for (&link, colour) in shown.iter().zip(palette(shown.len())) {
        colours[link] = colour;
    }
    colours
}

/// Links that have shapes, in body order.
fn shown(drawing: &Drawing) -> Vec<usize> {
    let mut links: Vec<usize> = drawing
        .shapes
        .iter()
        .map(|shape| shape.0 as usize)
        .collect();
    links.dedup();
    links
}

/// A colour for each link, neighbours in the order well apart: hues by the golden angle, none of them garish.
fn palette(links: usize) -> Vec<Rgb> {
    const GOLDEN: f64 = 137.507_764_050_037_85;
    (0..links)
        .map(|link| {
            let hue = (210.0 + GOLDEN * link as f64) % 360.0;
            let tint = |offset: f64| {
                // a smooth hue circle: three raised cosines a third of a turn apart
                let wave = 0.5 + 0.5 * (hue - offset).to_radians().cos();
                (255.0 * (0.42 + 0.5 * wave)).round() as u8
            };
            let pure = [tint(0.0), tint(120.0), tint(240.0)];
            // every other turn of hues is paler
            mix(
                pure,
                [235, 235, 235],
                if link % 2 == 0 { 0.0 } else { 0.25 },
            )
        })
        .collect()
}

/// Small text for a width [pixels] with margins; its middle is left out if it is longer.
pub(super) fn clipped(name: &str, width: usize) -> String {
    let letters = (width - 48) / Size::Small.advance();
    let all: Vec<char> = name.chars().collect();
    if all.len() <= letters {
        return name.to_owned();
    }
    let tail = (letters - 2) / 2;
    let head = letters - 2 - tail;
    let (head, tail) = (&all[..head], &all[all.len() - tail..]);
    head.iter().chain(&['.', '.']).chain(tail).collect()
}
