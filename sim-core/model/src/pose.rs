//! Position and orientation of a frame, in f64.

/// How far a quaternion's length may be from 1: figures rounded to two digits, such as 0.7 or 0.71, pass.
pub(crate) const QUAT_SLACK: f64 = 0.02;

/// A frame in its parent's frame: `x_parent = R x + pos`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Origin of the frame [m].
    pub pos: [f64; 3],
    /// Orientation of the frame, unit quaternion (x, y, z, w) [–].
    pub quat: [f64; 4],
}

impl Default for Pose {
    fn default() -> Pose {
        Pose::identity()
    }
}

impl Pose {
    /// The parent's frame itself.
    pub const fn identity() -> Pose {
        Pose {
            pos: [0.0; 3],
            quat: [0.0, 0.0, 0.0, 1.0],
        }
    }

    /// Origin at `pos` [m], axes parallel to the parent's.
    pub const fn at(pos: [f64; 3]) -> Pose {
        Pose {
            pos,
            quat: [0.0, 0.0, 0.0, 1.0],
        }
    }

    /// URDF's `<origin xyz rpy>`: roll, pitch, yaw [rad] about the parent's fixed x, y, z axes, in that order.
    pub fn from_rpy(pos: [f64; 3], rpy: [f64; 3]) -> Pose {
        let (sr, cr) = libm::sincos(0.5 * rpy[0]);
        let (sp, cp) = libm::sincos(0.5 * rpy[1]);
        let (sy, cy) = libm::sincos(0.5 * rpy[2]);
        // q = q_z(yaw) q_y(pitch) q_x(roll)
        let quat = [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ];
        Pose { pos, quat }.normalized()
    }

    /// Rotation by `angle` [rad] about the unit vector `axis` through the origin.
    pub fn about(axis: [f64; 3], angle: f64) -> Pose {
        let (sin, cos) = libm::sincos(0.5 * angle);
        Pose {
            pos: [0.0; 3],
            quat: [sin * axis[0], sin * axis[1], sin * axis[2], cos],
        }
    }

    /// This frame followed by `child`, which is given in this frame.
    pub fn mul(&self, child: &Pose) -> Pose {
        let [ax, ay, az, aw] = self.quat;
        let [bx, by, bz, bw] = child.quat;
        let quat = [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ];
        Pose {
            pos: self.transform(child.pos),
            quat,
        }
        .normalized()
    }

    /// The parent's frame, given in this frame.
    pub fn inverse(&self) -> Pose {
        let [x, y, z, w] = self.quat;
        let back = Pose {
            pos: [0.0; 3],
            quat: [-x, -y, -z, w],
        };
        let pos = back.rotate(self.pos);
        Pose {
            pos: [-pos[0], -pos[1], -pos[2]],
            quat: back.quat,
        }
    }

    /// Rotation matrix by rows; its columns are the axes of this frame in the parent. `(3, 3)` [–]
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        let [x, y, z, w] = self.quat;
        // 2 / |q|² makes a rotation of a quaternion that is a unit to a few digits only
        let two = 2.0 / (x * x + y * y + z * z + w * w);
        [
            [
                1.0 - two * (y * y + z * z),
                two * (x * y - w * z),
                two * (x * z + w * y),
            ],
            [
                two * (x * y + w * z),
                1.0 - two * (x * x + z * z),
                two * (y * z - w * x),
            ],
            [
                two * (x * z - w * y),
                two * (y * z + w * x),
                1.0 - two * (x * x + y * y),
            ],
        ]
    }

    /// A vector of this frame in the parent's axes.
    pub fn rotate(&self, vector: [f64; 3]) -> [f64; 3] {
        self.rotation()
            .map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
    }

    /// A point of this frame in the parent's frame [m].
    pub fn transform(&self, point: [f64; 3]) -> [f64; 3] {
        let turned = self.rotate(point);
        [
            self.pos[0] + turned[0],
            self.pos[1] + turned[1],
            self.pos[2] + turned[2],
        ]
    }

    /// The same tensor `(3, 3)`, given in this frame's axes, in the parent's: R T Rᵀ.
    pub fn rotate_tensor(&self, tensor: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
        let r = self.rotation();
        let mut turned = [[0.0; 3]; 3];
        for (i, row) in turned.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                for k in 0..3 {
                    for l in 0..3 {
                        *entry += r[i][k] * tensor[k][l] * r[j][l];
                    }
                }
            }
        }
        turned
    }

    /// Length of the quaternion, 1 for a rotation.
    pub fn quat_length(&self) -> f64 {
        self.quat.iter().map(|part| part * part).sum::<f64>().sqrt()
    }

    /// The same pose with a quaternion of length 1.
    ///
    /// A quaternion with a larger length error than [`QUAT_SLACK`] stays as it is: that is a mistake, not rounding, and
    /// `validate` refuses it.
    pub fn normalized(&self) -> Pose {
        let length = self.quat_length();
        let error = (length - 1.0).abs();
        // one that is a unit to the last bit stays as it was written
        if error > f64::EPSILON && error <= QUAT_SLACK {
            Pose {
                pos: self.pos,
                quat: self.quat.map(|part| part / length),
            }
        } else {
            *self
        }
    }
}
