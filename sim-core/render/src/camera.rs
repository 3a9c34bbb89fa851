//! Cameras: which rays an image has.

/// A camera with pinhole projection. Its frame has x to the right, y down and z forward, as OpenCV's and ROS's optical frames.
///
/// A ray goes through the middle of each pixel. Its direction has length 1 along z, so distances along it are depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths along x and y [pixels].
    pub focal: [f32; 2],
    /// The principal point, from the upper left corner of the image [pixels].
    pub center: [f32; 2],
    /// Depths from here on are seen [m].
    pub near: f32,
    /// Depths up to here are seen [m].
    pub far: f32,
}

impl Camera {
    /// A camera whose principal point is the middle of the image, with a vertical field of view [rad], which sees all depths
    /// up to `far` [m].
    pub fn with_fov(width: usize, height: usize, fov: f32, far: f32) -> Camera {
        let focal = 0.5 * height as f32 / (0.5 * fov).tan();
        Camera {
            width,
            height,
            focal: [focal; 2],
            center: [0.5 * width as f32, 0.5 * height as f32],
            near: 0.0,
            far,
        }
    }

    /// Whether rays have directions: focal lengths are positive, and all numbers but `far` finite.
    pub fn is_valid(&self) -> bool {
        self.focal.iter().all(|&f| f > 0.0 && f.is_finite())
            && self.center.iter().all(|c| c.is_finite())
            && self.near.is_finite()
            && !self.far.is_nan()
    }

    /// Where the ray of a column, or of a row, is at depth 1; `axis` is 0 for columns.
    #[inline(always)]
    pub(crate) fn at(&self, axis: usize, pixel: usize) -> f32 {
        (pixel as f32 + 0.5 - self.center[axis]) / self.focal[axis]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_without_directions_of_rays_is_not_valid() {
        let camera = Camera::with_fov(8, 8, 0.3, f32::INFINITY);
        assert!(camera.is_valid());
        for focal in [
            [0.0, 8.0],
            [8.0, -8.0],
            [f32::NAN, 8.0],
            [8.0, f32::INFINITY],
        ] {
            assert!(!Camera { focal, ..camera }.is_valid(), "{focal:?}");
        }
        let center = [4.0, f32::NAN];
        assert!(!Camera { center, ..camera }.is_valid());
        assert!(!Camera::with_fov(8, 0, 0.3, 10.0).is_valid());
        assert!(!Camera::with_fov(8, 8, 4.0, 10.0).is_valid());
    }
}
