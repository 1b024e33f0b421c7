//! What can be wrong with an input, each with a sentence that says what would be right.

use thiserror::Error;

/// Errors of the kernels. All are the caller's to mend; `python.rs` raises them as `ValueError`.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CoreError {
    #[error("{what} has a NaN or infinite number; every entry must be finite")]
    NotFinite { what: &'static str },
    #[error("{what} must have shape {expected}, got {got}")]
    WrongShape { what: &'static str, expected: String, got: String },
    #[error("a shape needs at least one primitive")]
    NoPrimitives,
    #[error("primitive {index} has half sizes {half:?}; each must be more than 0")]
    ZeroSize { index: usize, half: [f64; 3] },
    #[error(
        "primitive {index} has kind {kind}; 0 is a cuboid, 1, 2, 3 a cylinder along x, y, z, \
         4 to 7, 8 to 11, 12 to 15 a wedge along them, 16, 17, 18 a frustum, 19, 20, 21 a round one, 22, 23, 24 a torus"
    )]
    UnknownKind { index: usize, kind: f64 },
    #[error("primitive {index}: {fault}")]
    BadPrimitive { index: usize, fault: &'static str },
    #[error("primitive {index} is a frustum or a torus, whose row has 12 numbers; got 8")]
    ShortRow { index: usize },
    #[error("primitive {index} has op {op}; 1 adds, 0 subtracts")]
    UnknownOp { index: usize, op: f64 },
    #[error("camera rotation must be orthonormal with determinant +1 (rows: right, down, forward)")]
    NotARotation,
    #[error("camera fov_degrees must lie between 0 and 180, got {0}")]
    FieldOfView(f64),
    #[error("camera needs 0 < near < far, got near {near} and far {far}")]
    DepthRange { near: f64, far: f64 },
    #[error("the camera's position {0:?} lies inside the shape; move it outside")]
    EyeInside([f64; 3]),
    #[error("config: {0}")]
    Config(String),
    #[error("line style: {0}")]
    Style(String),
    #[error("views must be between 1 and 13 (there are 13 viewpoints), got {0}")]
    Views(usize),
    #[error(
        "the grammar found no acceptable shape in {attempts} attempts; \
         allow smaller shapes (min_occupancy) or other sizes"
    )]
    NoShape { attempts: u32 },
    #[error("could not start {threads} threads: {reason}")]
    Threads { threads: usize, reason: String },
    #[error("the weights do not fit the network of their config: {0}")]
    Misfit(String),
    #[error("{what} must be whole, 1 to {most}, got {width}", most = crate::network::widths::MAX_WIDTH)]
    Width { what: &'static str, width: usize },
    #[error("a width of {width} cannot be shared by {among} {what}")]
    CannotShare { width: usize, among: usize, what: &'static str },
    #[error("counts must add up to the number of drawings, {drawings}; got {counts:?}")]
    Counts { counts: Vec<usize>, drawings: usize },
    #[error("each object needs at least one drawing; object {object} has none")]
    NoDrawings { object: usize },
    #[error("the batch was stopped before it was finished")]
    Stopped,
}

/// Refuses numbers of which one is NaN or infinite.
pub fn all_finite(values: &[f32], what: &'static str) -> Result<(), CoreError> {
    // Without a way out of the inner loop it vectorises.
    let finite = |values: &[f32]| values.iter().fold(true, |finite, v| finite & (v.abs() < f32::INFINITY));
    if values.chunks(4096).all(finite) { Ok(()) } else { Err(CoreError::NotFinite { what }) }
}
