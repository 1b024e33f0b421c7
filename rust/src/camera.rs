//! Pinhole cameras, the 13 viewpoints, and the camera grid.
//!
//! ```text
//!   world: right-handed, y up          camera: x right, y down, z forward
//!   camera grid [slice][row][col]: slices between near and far, rows and columns of the image
//! ```

use crate::error::CoreError;
use glam::{DMat3, DVec3};

/// Pixels along each side of a drawing.
pub const IMAGE: usize = 256;
/// Numbers of a packed camera: position, rotation row by row, fov in degrees, near, far.
pub const PACKED: usize = 15;

/// A pinhole camera with a square image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub position: DVec3,
    /// The camera's axes in the world: right, down, forward.
    pub axes: [DVec3; 3],
    pub fov_degrees: f64,
    pub near: f64,
    pub far: f64,
    /// Half of the image's side at distance 1.
    pub half_image: f64,
}

impl Camera {
    pub fn new(
        position: DVec3,
        axes: [DVec3; 3],
        fov_degrees: f64,
        near: f64,
        far: f64,
    ) -> Result<Self, CoreError> {
        if !position.is_finite() || !axes.iter().all(|a| a.is_finite()) {
            return Err(CoreError::NotFinite { what: "camera" });
        }
        let matrix = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let off = matrix.transpose() * matrix - DMat3::IDENTITY;
        if off.to_cols_array().iter().any(|e| e.abs() > 1e-4) || matrix.determinant() < 0.0 {
            return Err(CoreError::NotARotation);
        }
        if !(fov_degrees > 0.0 && fov_degrees < 180.0) {
            return Err(CoreError::FieldOfView(fov_degrees));
        }
        if !(near > 0.0 && near < far && far.is_finite()) {
            return Err(CoreError::DepthRange { near, far });
        }
        let half_image = (fov_degrees.to_radians() / 2.0).tan();
        Ok(Self { position, axes, fov_degrees, near, far, half_image })
    }

    pub fn from_packed(row: &[f64; PACKED]) -> Result<Self, CoreError> {
        let at = |i: usize| DVec3::new(row[i], row[i + 1], row[i + 2]);
        Self::new(at(0), [at(3), at(6), at(9)], row[12], row[13], row[14])
    }

    pub fn to_packed(&self) -> [f64; PACKED] {
        let mut row = [0.0; PACKED];
        for (i, v) in [self.position, self.axes[0], self.axes[1], self.axes[2]].iter().enumerate() {
            row[3 * i..3 * i + 3].copy_from_slice(&v.to_array());
        }
        row[12..].copy_from_slice(&[self.fov_degrees, self.near, self.far]);
        row
    }

    /// At a distance from the origin, looking at it, then rolled about its own z axis. In degrees; azimuth
    /// from +x towards +z, elevation above the horizon.
    pub fn orbit(azimuth: f64, elevation: f64, roll: f64, distance: f64) -> Self {
        let (sa, ca) = azimuth.to_radians().sin_cos();
        let (se, ce) = elevation.to_radians().sin_cos();
        let away = DVec3::new(ce * ca, se, ce * sa);
        let right = DVec3::new(sa, 0.0, -ca);
        let down = (-away).cross(right);
        let (sr, cr) = roll.to_radians().sin_cos();
        let axes = [right * cr + down * sr, down * cr - right * sr, -away];
        Self::new(away * distance, axes, FOV_DEGREES, NEAR, FAR).expect("an orbit is a valid camera")
    }

    /// World to camera coordinates.
    #[inline(always)]
    pub fn to_camera(&self, point: DVec3) -> DVec3 {
        let p = point - self.position;
        DVec3::new(self.axes[0].dot(p), self.axes[1].dot(p), self.axes[2].dot(p))
    }

    /// The world direction through an image point, as long as one unit of depth; x and y in [-1, 1] from the
    /// image's centre to its borders.
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        let h = self.half_image;
        self.axes[0] * (x * h) + self.axes[1] * (y * h) + self.axes[2]
    }

    /// Depth of the middle of one of so many slices.
    pub fn slice_depth(&self, slice: usize, slices: usize) -> f64 {
        self.near + (slice as f64 + 0.5) * (self.far - self.near) / slices as f64
    }

    /// The camera moved by a vector in its own axes.
    pub fn displaced(mut self, by: DVec3) -> Self {
        self.position += self.axes[0] * by.x + self.axes[1] * by.y + self.axes[2] * by.z;
        self
    }

    /// Carried around the origin, which it sees where it saw it before: by degrees about its own axis to the right and
    /// about that which points down, both at once.
    pub fn turned(mut self, right: f64, down: f64) -> Self {
        let angle = right.hypot(down);
        if angle > 0.0 {
            let axis = (self.axes[0] * right + self.axes[1] * down) / angle;
            let turn = DMat3::from_axis_angle(axis.normalize(), angle.to_radians());
            self.position = turn * self.position;
            self.axes = self.axes.map(|a| turn * a);
        }
        self
    }

    /// With a field of view larger by this share, as far away as makes what lies at the origin look as large.
    pub fn widened(&self, share: f64) -> Self {
        let fov = (self.fov_degrees * (1.0 + share)).clamp(1.0, 170.0);
        let ratio = self.half_image / (fov.to_radians() / 2.0).tan();
        let by = (ratio - 1.0) * self.to_camera(DVec3::ZERO).z;
        let position = self.position - self.axes[2] * by;
        let near = (self.near + by).max(0.05);
        Self::new(position, self.axes, fov, near, (self.far + by).max(2.0 * near)).unwrap_or(*self)
    }

    /// How much of the displacement `by` (camera axes), between 0 and 1, leaves every point inside image and
    /// depth range. All conditions are linear in it.
    pub fn room_for(&self, by: DVec3, points: &[DVec3]) -> f64 {
        let h = self.half_image;
        let mut share = 1.0f64;
        for p in points.iter().map(|&p| self.to_camera(p)) {
            // Each condition reads: slack - share * used >= 0.
            let conditions = [
                (h * p.z - p.x, h * by.z - by.x),
                (h * p.z + p.x, h * by.z + by.x),
                (h * p.z - p.y, h * by.z - by.y),
                (h * p.z + p.y, h * by.z + by.y),
                (p.z - self.near, by.z),
                (self.far - p.z, -by.z),
            ];
            for (slack, used) in conditions {
                if used > 0.0 {
                    share = share.min((slack / used).max(0.0));
                }
            }
        }
        share
    }
}

/// Field of view of a viewpoint.
pub const FOV_DEGREES: f64 = 45.0;
/// Depths of a viewpoint's first and last slice.
pub const NEAR: f64 = 1.25;
pub const FAR: f64 = 2.75;
/// Distance of a viewpoint from the origin.
pub const DISTANCE: f64 = 2.0;

/// Azimuth and elevation of the viewpoints: eight three-quarter views, front, right, back, left, top.
pub const VIEWPOINTS: [(f64, f64); 13] = [
    (37.5, 38.0),
    (52.5, 38.0),
    (127.5, 38.0),
    (142.5, 38.0),
    (217.5, 38.0),
    (232.5, 38.0),
    (307.5, 38.0),
    (322.5, 38.0),
    (0.0, 0.0),
    (90.0, 0.0),
    (180.0, 0.0),
    (270.0, 0.0),
    (TOP_AZIMUTH, 90.0),
];
/// How many of the viewpoints, from the first, a single view may be drawn from.
pub const QUARTER_VIEWS: usize = 8;
/// Seen from the top, the image's right is +x and its top -z.
const TOP_AZIMUTH: f64 = 90.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewpoint_looks_at_the_origin() {
        for (azimuth, elevation) in VIEWPOINTS {
            let camera = Camera::orbit(azimuth, elevation, 0.0, DISTANCE);
            let seen = camera.to_camera(DVec3::ZERO);
            assert!((seen - DVec3::new(0.0, 0.0, 2.0)).length() < 1e-12);
            assert!(camera.axes[0].y.abs() < 1e-12, "the horizon is level");
            let again = Camera::from_packed(&camera.to_packed()).unwrap();
            assert_eq!(again, camera);
        }
        let top = Camera::orbit(TOP_AZIMUTH, 90.0, 0.0, DISTANCE);
        assert!((top.axes[0] - DVec3::X).length() < 1e-12 && (top.axes[1] - DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn degenerate_cameras_are_refused() {
        let good = Camera::orbit(37.5, 38.0, 0.0, 2.0).to_packed();
        let with = |i: usize, v: f64| {
            let mut row = good;
            row[i] = v;
            Camera::from_packed(&row).unwrap_err()
        };
        assert!(matches!(with(0, f64::NAN), CoreError::NotFinite { .. }));
        assert_eq!(with(3, 5.0), CoreError::NotARotation);
        assert_eq!(with(12, 0.0), CoreError::FieldOfView(0.0));
        assert_eq!(with(12, 180.0), CoreError::FieldOfView(180.0));
        assert!(matches!(with(13, 0.0), CoreError::DepthRange { .. }));
        assert!(matches!(with(14, 1.0), CoreError::DepthRange { .. }));
    }

    #[test]
    fn room_ends_where_a_point_meets_the_border() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let points = [DVec3::new(0.0, 0.3, 0.0)];
        // Moving down by d puts the point at y = -0.3 - d; the image ends at y = -2 tan(22.5).
        let border = 2.0 * 22.5f64.to_radians().tan();
        let share = camera.room_for(DVec3::new(0.0, 1.0, 0.0), &points);
        assert!((share - (border - 0.3)).abs() < 1e-12, "{share}");
        assert_eq!(camera.room_for(DVec3::new(0.0, 0.1, 0.0), &points), 1.0);
    }
}
