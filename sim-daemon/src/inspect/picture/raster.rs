//! Triangles to pixels: a depth buffer of nine samples a pixel, two lights, and ink along edges.
//!
//! The panel is rendered in bands of rows, each with a depth buffer of its own, by as many threads as there are cores; what
//! a band shows depends on no other.

use std::sync::Mutex;

use super::backdrop::Backdrop;
use super::canvas::{Canvas, Rgb};
use super::surface::{Facet, Surface};
use sim_picture::View;
use sim_picture::vector::{Vector, along, dot, unit};

/// Samples a pixel, along each side.
const FINE: usize = 3;
/// Rows of a band [pixels]: its buffer stays in cache.
const BAND: usize = 16;
/// Parts of a sample in which corners are placed: exact, so that neighbours leave no gap.
const SUB: f64 = 16.0;
/// How far ink reaches from an edge [samples].
const INK: usize = 2;
/// Cosine of the angle between facets above which they have an edge: 30°.
const CREASE: f32 = 0.866;
/// Step in depth that is an edge, in parts of the size of the robot.
const STEP: f64 = 0.012;

/// What is seen at a sample.
#[derive(Clone, Copy)]
struct Sample {
    /// How near it is; minus infinity where nothing is.
    near: f32,
    link: u32,
    /// Unit normal in the world.
    normal: [f32; 3],
}

const NOTHING: Sample = Sample {
    near: f32::NEG_INFINITY,
    link: u32::MAX,
    normal: [0.0; 3],
};

/// Corners of a facet in the panel: samples in [`SUB`]ths, and how near each is.
struct Corners {
    place: [[i64; 2]; 3],
    near: [f32; 3],
}

/// Where the light comes from.
struct Lights {
    key: Vector,
    fill: Vector,
}

/// A picture of the surface, its links in these colours.
pub(super) fn render(
    surface: &Surface,
    view: &View,
    colours: &[Rgb],
    backdrop: &Backdrop,
) -> Canvas {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    render_on(threads, surface, view, colours, backdrop)
}

pub(super) fn render_on(
    threads: usize,
    surface: &Surface,
    view: &View,
    colours: &[Rgb],
    backdrop: &Backdrop,
) -> Canvas {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut canvas = Canvas::new(width, height, [255; 3]);
    let middle = surface.middle();
    let projected: Vec<Corners> = surface
        .facets
        .iter()
        .map(|facet| {
            let at = facet
                .corners
                .map(|corner| view.project(along(middle, 1.0, corner.map(f64::from))));
            Corners {
                place: at.map(|[x, y, _]| {
                    [x, y].map(|pixels| (pixels * FINE as f64 * SUB).round() as i64)
                }),
                near: at.map(|[_, _, near]| near as f32),
            }
        })
        .collect();
    // the key light is over the viewer's left shoulder, the fill light low on the right
    let lit = |right: f64, up: f64, into: f64| {
        let aside = along(view.right.map(|part| part * right), up, view.up);
        unit(along(aside, into, view.into))
    };
    let lights = Lights {
        key: lit(-0.45, 0.75, -0.75),
        fill: lit(0.8, -0.1, -0.5),
    };
    let size = surface.size();
    let bands = bands(&projected, height.div_ceil(BAND));
    let draw = |rows: &mut [Rgb], band: usize| {
        let first_row = band * BAND;
        let facets = bands[band]
            .iter()
            .map(|&index| (&surface.facets[index as usize], &projected[index as usize]));
        let samples = samples(facets, width, first_row, rows.len() / width);
        for (index, pixel) in rows.iter_mut().enumerate() {
            let (x, y) = (index % width, index / width);
            let behind = || backdrop.colour(view, x, first_row + y);
            let neighbours = Neighbours {
                samples: &samples,
                width: width * FINE,
                step: STEP * size,
                view,
            };
            *pixel = resolve(&neighbours, x, y, behind, |sample| {
                shade(sample, colours[sample.link as usize], &lights)
            });
        }
    };
    let left = Mutex::new(canvas.pixels.chunks_mut(BAND * width).enumerate());
    let next = || left.lock().unwrap_or_else(|held| held.into_inner()).next();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((band, rows)) = next() {
                    draw(rows, band);
                }
            });
        }
    });
    canvas
}

/// Which facets are seen in each band, in their order.
fn bands(projected: &[Corners], count: usize) -> Vec<Vec<u32>> {
    let tall = BAND as i64 * FINE as i64 * SUB as i64;
    let ink = INK as i64 * SUB as i64;
    let mut bands = vec![Vec::new(); count];
    for (index, Corners { place, .. }) in projected.iter().enumerate() {
        let rows = place.map(|[_, y]| y);
        let low = rows.into_iter().min().unwrap_or(0) - ink;
        let high = rows.into_iter().max().unwrap_or(0) + ink;
        let first = low.div_euclid(tall).clamp(0, count as i64) as usize;
        let end = (high.div_euclid(tall) + 1).clamp(0, count as i64) as usize;
        for band in bands.iter_mut().take(end).skip(first) {
            band.push(index as u32);
        }
    }
    bands
}

/// Samples of a band of rows, with [`INK`] rows of samples above and below.
fn samples<'a>(
    facets: impl Iterator<Item = (&'a Facet, &'a Corners)>,
    width: usize,
    first_row: usize,
    rows: usize,
) -> Vec<Sample> {
    let (columns, lines) = (width * FINE, rows * FINE + 2 * INK);
    let top = (first_row * FINE) as i64 - INK as i64;
    let mut samples = vec![NOTHING; columns * lines];
    for (facet, corners) in facets {
        let normals = facet.normals;
        cover(&corners.place, columns, top, lines, |index, weights| {
            let near: f32 = (0..3).map(|k| weights[k] * corners.near[k]).sum();
            let sample = &mut samples[index];
            if near > sample.near {
                let normal = std::array::from_fn(|axis| {
                    (0..3)
                        .map(|k| weights[k] * f32::from(normals[k][axis]))
                        .sum::<f32>()
                });
                let length = normal.iter().map(|part: &f32| part * part).sum::<f32>();
                let scale = 1.0 / length.sqrt().max(1.0);
                *sample = Sample {
                    near,
                    link: facet.link,
                    normal: normal.map(|part| part * scale),
                };
            }
        });
    }
    samples
}

/// Calls `each` for the samples inside a triangle, rim included, with the weights of its corners.
///
/// Corners are in [`SUB`]ths of a sample; sample (i, j) of `columns` × `lines` is at (i + ½, j + ½ + top).
pub(super) fn cover(
    corners: &[[i64; 2]; 3],
    columns: usize,
    top: i64,
    lines: usize,
    mut each: impl FnMut(usize, [f32; 3]),
) {
    let middle = [[SUB as i64 / 2; 2]];
    let (wide, tall) = (0..columns as i64, top..top + lines as i64);
    sim_picture::cover(corners, &middle, wide, tall, |x, y, _, parts, whole| {
        let inverse = 1.0 / whole as f32;
        let index = (y - top) as usize * columns + x as usize;
        each(index, std::array::from_fn(|k| parts[k][0] as f32 * inverse));
    });
}

/// Colour of a surface under two lights and a sky.
fn shade(sample: &Sample, colour: Rgb, lights: &Lights) -> [f64; 3] {
    let normal = sample.normal.map(f64::from);
    let key = dot(normal, lights.key).max(0.0);
    let fill = dot(normal, lights.fill).max(0.0);
    let sky = 0.5 + 0.5 * normal[2];
    let light = 0.42 + 0.16 * sky + 0.44 * key + 0.16 * fill;
    let gleam = 24.0 * key.powi(24);
    colour.map(|part| f64::from(part) * light + gleam)
}

/// Samples of a band and how they are told apart.
struct Neighbours<'a> {
    samples: &'a [Sample],
    /// Samples in a row.
    width: usize,
    /// Step in depth that is an edge [m].
    step: f64,
    view: &'a View,
}

impl Neighbours<'_> {
    /// How much ink lies on a sample, from 0 to 1.
    fn ink(&self, index: usize) -> f64 {
        let own = &self.samples[index];
        let column = index % self.width;
        let pairs = [
            (column >= INK && column + INK < self.width).then(|| [index - INK, index + INK]),
            Some([index - INK * self.width, index + INK * self.width]),
        ];
        let mut ink: f64 = 0.0;
        for pair in pairs.into_iter().flatten() {
            let around = pair.map(|place| &self.samples[place]);
            if around.iter().any(|other| other.link != own.link) {
                return 0.8;
            }
            if own.link == u32::MAX {
                continue;
            }
            // on a plane, however steep, the second difference of `near` is 0
            let bend =
                f64::from(around[0].near) + f64::from(around[1].near) - 2.0 * f64::from(own.near);
            let deep = bend.abs() * self.view.depth_of_near(f64::from(own.near));
            if deep > self.step {
                ink = ink.max(0.65);
            }
            let turned = around.iter().any(|other| {
                let cosine: f32 = (0..3).map(|k| other.normal[k] * own.normal[k]).sum();
                cosine < CREASE
            });
            if turned {
                ink = ink.max(0.3);
            }
        }
        ink
    }
}

/// The mean of the samples of a pixel; (x, y) counts from the band's first.
fn resolve(
    neighbours: &Neighbours,
    x: usize,
    y: usize,
    behind: impl Fn() -> Rgb,
    shade: impl Fn(&Sample) -> [f64; 3],
) -> Rgb {
    let mut sum = [0.0; 3];
    let mut background: Option<[f64; 3]> = None;
    for line in 0..FINE {
        for column in 0..FINE {
            let row = y * FINE + line + INK;
            let index = row * neighbours.width + x * FINE + column;
            let sample = &neighbours.samples[index];
            let colour = if sample.link == u32::MAX {
                *background.get_or_insert_with(|| behind().map(f64::from))
            } else {
                shade(sample)
            };
            let light = 1.0 - neighbours.ink(index);
            for part in 0..3 {
                sum[part] += colour[part] * light;
            }
        }
    }
    sum.map(|part| (part / (FINE * FINE) as f64).round().clamp(0.0, 255.0) as u8)
}
