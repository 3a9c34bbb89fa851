//! Cameras: a direction to look along, and where a point of the world lies in the picture.

use crate::vector::{Vector, along, cross, dot, extent, middle, sub, unit};

/// Half the angle of view of the perspective, its tangent: 14°, as of a long lens.
const HALF_ANGLE: f64 = 0.25;

/// A camera for a panel of the page.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Unit vectors of the camera in the world: to the right.
    pub right: Vector,
    /// Up.
    pub up: Vector,
    /// Into the picture.
    pub into: Vector,
    /// Where the camera is; without perspective, any point on the line of sight of the panel's middle [m].
    pub eye: Vector,
    /// Whether what is far is small.
    pub perspective: bool,
    /// Width of the panel [pixels].
    pub width: f64,
    /// Height of the panel [pixels].
    pub height: f64,
    /// Pixels a metre; in perspective, at a distance of 1 m.
    pub scale: f64,
}

impl View {
    /// A camera at `eye` [m] that looks at `target`, and sees `height` pixels in this angle [rad].
    ///
    /// `up` is what should be up; where it is along the line of sight, x is, or y.
    pub fn looking(
        eye: Vector,
        target: Vector,
        up: Vector,
        angle: f64,
        [width, height]: [usize; 2],
    ) -> View {
        let into = match unit(sub(target, eye)) {
            [0.0, 0.0, 0.0] => [0.0, 1.0, 0.0],
            into => into,
        };
        let square = |a: Vector| dot(a, a);
        let aside = [up, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .map(|up| cross(into, unit(up)))
            .into_iter()
            .find(|&aside| square(aside) > 1e-9)
            .unwrap_or([1.0, 0.0, 0.0]);
        let right = unit(aside);
        View {
            right,
            up: cross(right, into),
            into,
            eye,
            perspective: true,
            width: width as f64,
            height: height as f64,
            scale: 0.5 * height as f64 / (0.5 * angle).tan(),
        }
    }

    /// A camera that looks along `into` and sees all points, with margins beside and above them [pixels].
    ///
    /// `up` is what should be up; it must not be along `into`. All points in one place are shown as if 1 m wide.
    pub fn fitted(
        into: Vector,
        up: Vector,
        perspective: bool,
        [width, height]: [usize; 2],
        margin: [f64; 2],
        points: impl Iterator<Item = Vector> + Clone,
    ) -> View {
        let into = unit(into);
        let right = unit(cross(into, up));
        let mut view = View {
            right,
            up: cross(right, into),
            into,
            eye: [0.0; 3],
            perspective,
            width: width as f64,
            height: height as f64,
            scale: 1.0,
        };
        let half = [0.5 * view.width - margin[0], 0.5 * view.height - margin[1]];
        if perspective {
            view.scale = 0.5 * view.width.min(view.height) / HALF_ANGLE;
            view.eye = view.stand_back(half.map(|half| half / view.scale), points);
        } else {
            let [low, high] = extent(points.map(|point| view.place(point)));
            let size = [high[0] - low[0], high[1] - low[1]];
            let scale = |axis: usize| 2.0 * half[axis] / size[axis];
            view.scale = scale(0).min(scale(1));
            if !view.scale.is_finite() {
                view.scale = 2.0 * half[0].min(half[1]);
            }
            let centre = middle([low, high]);
            view.eye = view.world(centre);
        }
        view
    }

    /// The nearest place from which all points are within these tangents of the line of sight.
    ///
    /// With a point at (r, u, f) in camera axes and the eye at (x, y, z), |r − x| ≤ t (f − z) is r − t f ≤ x − t z and
    /// −r − t f ≤ −x − t z. The largest of each left side, A and B, give z ≤ −(A + B) / 2t and x = (A − B) / 2.
    fn stand_back(
        &self,
        tangents: [f64; 2],
        points: impl Iterator<Item = Vector> + Clone,
    ) -> Vector {
        let mut bounds = [[f64::NEG_INFINITY; 2]; 2];
        let mut nearest = f64::INFINITY;
        for point in points {
            let point = self.place(point);
            for axis in 0..2 {
                let forth = tangents[axis] * point[2];
                bounds[axis][0] = bounds[axis][0].max(point[axis] - forth);
                bounds[axis][1] = bounds[axis][1].max(-point[axis] - forth);
            }
            nearest = nearest.min(point[2]);
        }
        let back = |axis: usize| -(bounds[axis][0] + bounds[axis][1]) / (2.0 * tangents[axis]);
        let aside = |axis: usize| 0.5 * (bounds[axis][0] - bounds[axis][1]);
        let depth = back(0).min(back(1));
        if !depth.is_finite() {
            return self.world([0.0, 0.0, -0.5 / HALF_ANGLE]);
        }
        // a single point, or several behind each other, would be at the eye
        let room = if nearest - depth > 1e-9 {
            0.0
        } else {
            0.5 / HALF_ANGLE
        };
        self.world([aside(0), aside(1), depth - room])
    }

    /// A point in camera axes, from the world's origin: right, up, into.
    fn place(&self, point: Vector) -> Vector {
        [
            dot(point, self.right),
            dot(point, self.up),
            dot(point, self.into),
        ]
    }

    /// A point given in camera axes, in the world.
    fn world(&self, [right, up, into]: Vector) -> Vector {
        let point = self.right.map(|part| part * right);
        along(along(point, up, self.up), into, self.into)
    }

    /// Where a point lies in the panel [pixels from the upper left], and how near it is: a number that is linear over
    /// the panel on any plane, larger where nearer.
    pub fn project(&self, point: Vector) -> [f64; 3] {
        let [right, up, into] = self.place(sub(point, self.eye));
        let (scale, near) = if self.perspective {
            (self.scale / into, 1.0 / into)
        } else {
            (self.scale, -into)
        };
        [
            0.5 * self.width + scale * right,
            0.5 * self.height - scale * up,
            near,
        ]
    }
}
