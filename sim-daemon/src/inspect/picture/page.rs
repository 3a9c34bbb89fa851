//! The page: where each view lies, its labels, and the legend.

use sim_model::Pose;

use super::Drawing;
use super::canvas::{Canvas, PAPER, Size};
use super::legend::{BONE, Legend, QUIET, RULE, TEXT, clipped, colours};
use super::paper::{AXES, graph_paper, round_spacing};
use super::solids::Solids;
use sim_picture::View;
use sim_picture::vector::{Vector, extent};

/// Size of the page [pixels].
const WIDTH: usize = 1600;
const HEIGHT: usize = 1200;
/// Height of the title [pixels].
const TITLE: usize = 72;
/// Width of the three-quarter view [pixels].
const MAIN: usize = 1060;

/// Views without perspective: name, line of sight, up, and the axes that run to the right and up.
const SIDES: [(&str, Vector, Vector, [usize; 2]); 3] = [
    ("side", [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0, 2]),
    ("front", [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1, 2]),
    ("top", [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0, 1]),
];
/// Line of sight of the three-quarter view: from the front right, 22° from above.
const OBLIQUE: Vector = [-0.6, 0.71, -0.375];

pub(super) fn render(drawing: &Drawing) -> Canvas {
    let mut page = Canvas::new(WIDTH, HEIGHT, PAPER);
    let scene = Scene::new(drawing);
    let legend = Legend::new(drawing, MAIN);
    let main = [MAIN, HEIGHT - TITLE - legend.height()];
    page.paste(0, TITLE, &scene.oblique(main, &drawing.caption));
    let (left, width) = (MAIN + 1, WIDTH - MAIN - 1);
    let height = (HEIGHT - TITLE - 2) / 3;
    for (place, side) in SIDES.iter().enumerate() {
        let top = TITLE + place * (height + 1);
        page.paste(left, top, &scene.side(side, [width, height]));
        if place > 0 {
            page.rectangle(left as i64, top as i64 - 1, width as i64, 1, RULE);
        }
    }
    page.rectangle(MAIN as i64, TITLE as i64, 1, (HEIGHT - TITLE) as i64, RULE);
    page.rectangle(0, TITLE as i64 - 1, WIDTH as i64, 1, RULE);
    // its letters are nearly twice as wide
    let title = clipped(&drawing.title, MAIN / 2);
    page.text(24, 12, &title, Size::Large, TEXT);
    page.text(24, 42, &drawing.summary, Size::Small, QUIET);
    legend.draw(&mut page, (TITLE + main[1]) as i64);
    page
}

/// What all views show.
struct Scene<'a> {
    drawing: &'a Drawing,
    solids: Solids,
    /// Height of the lowest point or frame [m].
    lowest: f64,
    /// Length of the axes of a frame that is drawn [m].
    arm: f64,
}

impl<'a> Scene<'a> {
    fn new(drawing: &'a Drawing) -> Scene<'a> {
        let mut solids = Solids::new(&drawing.shapes, &drawing.surroundings, &colours(drawing));
        if drawing.shapes.is_empty() {
            solids.extent = extent(drawing.frames.iter().map(|(frame, _)| frame.pos));
        }
        let arm = 0.16 * solids.size();
        let lowest = solids.extent[0][2];
        if drawing.shapes.is_empty() {
            // the frames' axes belong to what is seen
            let [low, high] = solids.extent;
            solids.extent = [low.map(|part| part - arm), high.map(|part| part + arm)];
            let frames = drawing.frames.iter().map(|(frame, _)| frame);
            let ends = frames.flat_map(|frame| [frame.pos].into_iter().chain(tips(frame, arm)));
            solids.points = ends.collect();
        }
        Scene {
            drawing,
            solids,
            lowest,
            arm,
        }
    }

    /// The robot in perspective on its floor.
    fn oblique(&self, size: [usize; 2], caption: &str) -> Canvas {
        let up = [0.0, 0.0, 1.0];
        let view = View::fitted(
            OBLIQUE,
            up,
            true,
            size,
            [90.0; 2],
            self.solids.points.iter().copied(),
        );
        let paper = Canvas::new(size[0], size[1], PAPER);
        let size = self.solids.size();
        // a robot that stands at 0, to a rounding of its shapes, stands on 0
        let floor = if self.lowest.abs() < 0.02 * size {
            0.0
        } else {
            self.lowest
        };
        let spacing = round_spacing(size, 12.0);
        let mut canvas = self.solids.render(&view, Some([floor, spacing]), &paper);
        self.marks(&mut canvas, &view);
        let floor = format!(
            "floor at z = {} m, lines every {} m",
            number(floor, 3),
            shortest(spacing)
        );
        let bottom = canvas.height as i64;
        canvas.text(24, bottom - 52, &clipped(caption, MAIN), Size::Small, TEXT);
        canvas.text(24, bottom - 30, &floor, Size::Small, QUIET);
        canvas
    }

    /// One of the views without perspective on graph paper.
    fn side(
        &self,
        (name, into, up, axes): &(&str, Vector, Vector, [usize; 2]),
        size: [usize; 2],
    ) -> Canvas {
        let view = View::fitted(
            *into,
            *up,
            false,
            size,
            [84.0, 44.0],
            self.solids.points.iter().copied(),
        );
        let spacing = round_spacing(view.width / view.scale, 9.0);
        let paper = graph_paper(&view, spacing, *axes);
        let mut canvas = self.solids.render(&view, None, &paper);
        if self.drawing.shapes.is_empty() {
            self.marks(&mut canvas, &view);
        }
        ticks(&mut canvas, &view, spacing);
        let letters = ["x", "y", "z"];
        let label = format!("{name} [m]");
        canvas.text(14, 10, &label, Size::Small, TEXT);
        let (corner, reach) = ([size[0] as f64 - 62.0, 58.0], 34.0);
        for (axis, [x, y]) in axes.iter().zip([[1.0, 0.0], [0.0, -1.0]]) {
            let tip = [corner[0] + reach * x, corner[1] + reach * y];
            canvas.arrow(corner, tip, 2.0, AXES[*axis]);
            let (left, top) = (tip[0] + 10.0 * x - 4.0, tip[1] + 10.0 * y - 9.0);
            canvas.text(
                left as i64,
                top as i64,
                letters[*axis],
                Size::Small,
                AXES[*axis],
            );
        }
        canvas
    }

    /// The world's frame, and, where there are no shapes, those of the links and what joins them.
    fn marks(&self, canvas: &mut Canvas, view: &View) {
        let flat = |point: Vector| {
            let [x, y, _] = view.project(point);
            [x, y]
        };
        if self.drawing.shapes.is_empty() {
            for (frame, parent) in &self.drawing.frames {
                if let Some(parent) = parent {
                    let from = self.drawing.frames[*parent].0.pos;
                    canvas.line(flat(from), flat(frame.pos), 5.0, BONE);
                }
            }
            for (frame, _) in &self.drawing.frames {
                triad(canvas, view, frame, 0.6 * self.arm, 2.0);
            }
        }
        let inside = |point: Vector| {
            let [x, y] = flat(point);
            (0.0..view.width).contains(&x) && (0.0..view.height).contains(&y)
        };
        // a world's frame that is far from the robot is not in the picture
        if view.perspective && inside([0.0; 3]) {
            let tips = triad(canvas, view, &Pose::identity(), self.arm, 2.5);
            for (axis, [x, y]) in tips.into_iter().enumerate() {
                let [from_x, from_y] = flat([0.0; 3]);
                let away = (x - from_x).hypot(y - from_y).max(1.0);
                let (x, y) = (
                    x + 12.0 * (x - from_x) / away,
                    y + 12.0 * (y - from_y) / away,
                );
                let letter = ["x", "y", "z"][axis];
                canvas.label(x as i64 - 4, y as i64 - 9, letter, AXES[axis]);
            }
        }
    }
}

/// Draws the axes of a frame and returns where they end [pixels].
fn triad(canvas: &mut Canvas, view: &View, frame: &Pose, arm: f64, width: f64) -> [[f64; 2]; 3] {
    let flat = |point: Vector| {
        let [x, y, _] = view.project(point);
        [x, y]
    };
    let from = flat(frame.pos);
    let flat_tips = tips(frame, arm).map(flat);
    for (tip, colour) in flat_tips.into_iter().zip(AXES) {
        canvas.arrow(from, tip, width, colour);
    }
    flat_tips
}

/// Where axes of this length end [m].
fn tips(frame: &Pose, arm: f64) -> [Vector; 3] {
    std::array::from_fn(|axis| {
        let mut tip = [0.0; 3];
        tip[axis] = arm;
        frame.transform(tip)
    })
}

/// Coordinates of the lines of graph paper, along the lower and the left edge.
fn ticks(canvas: &mut Canvas, view: &View, spacing: f64) {
    let origin = view.project([0.0; 3]);
    let step = spacing * view.scale;
    let (width, height) = (canvas.width as f64, canvas.height as f64);
    let letter = Size::Small.advance() as f64;
    // the corner belongs to neither edge
    for line in (((64.0 - origin[0]) / step).ceil() as i64).. {
        let x = origin[0] + line as f64 * step;
        let text = shortest(line as f64 * spacing);
        let half = 0.5 * letter * text.len() as f64;
        if x + half > width - 4.0 {
            break;
        }
        let (left, top) = ((x - half).round() as i64, height as i64 - 20);
        canvas.label(left, top, &text, QUIET);
    }
    for line in (((origin[1] - height + 40.0) / step).ceil() as i64).. {
        let y = origin[1] - line as f64 * step;
        if y < 44.0 {
            break;
        }
        let text = shortest(line as f64 * spacing);
        canvas.label(8, y.round() as i64 - 9, &text, QUIET);
    }
}

/// At most so many decimals, without zeros at the end.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if decimals > 0 {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" { "0" } else { text }.to_owned()
}

/// A round number as short as it can be.
fn shortest(value: f64) -> String {
    // multiples of 0.1 and the like carry a rounding in their 16th digit
    let digits = format!("{value:.9e}").parse().unwrap_or(value) + 0.0;
    if digits != 0.0 && !(1e-3..1e5).contains(&f64::abs(digits)) {
        format!("{digits:e}")
    } else {
        format!("{digits}")
    }
}
