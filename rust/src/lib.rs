//! The kernels of sketchcore, in the order in which a shape travels:
//!
//! ```text
//! random -> grammar -> csg, fit -> voxel                      the truth, world grid
//!         triangle mesh -> solid ----^
//!               |       |
//!               |     camera ----> raycast -> buffers -> lines, kinds -> pen    the drawing
//!               +-> surface -----> raster ------^          +-> trace -> stroke (by style) -> brush
//!                                     |
//!                                     +------> buffers::fill_frustum        the truth, camera grid
//! batch: all of these for one sample, and samples side by side
//!
//! drawing -> distance -> carve, evidence                     what drawings say about space
//! drawing -> trace -> straight                               what its lines say about the camera
//! resample, lift                                             world grid <-> camera grid, <- image features
//! convolution -> network                                     drawings -> what is probably there, world grid
//! outlines                                                   what drawings ask of a volume
//! isosurface                                                 a volume as a camera sees it
//! mesh                                                       the surface that leaves the package
//! ```
//!
//! `raycast` asks `intersect` about each primitive, `evidence` and `outlines` where a `column` of voxels is seen; `dispatch` compiles the loops for several instruction sets.
//!
//! Only `python` knows about Python; everything else is plain Rust that `cargo test` runs.

pub mod batch;
pub mod brush;
pub mod buffers;
pub mod camera;
pub mod carve;
mod column;
pub mod convolution;
pub mod csg;
mod dispatch;
pub mod distance;
pub mod error;
pub mod evidence;
mod exponential;
pub mod fit;
pub mod grammar;
pub mod hatching;
mod intersect;
pub mod isosurface;
pub mod kinds;
pub mod lift;
pub mod lines;
pub mod mesh;
pub mod network;
pub mod outlines;
pub mod pen;
#[cfg(feature = "python")]
mod python;
pub mod random;
pub mod raster;
pub mod raycast;
pub mod resample;
pub mod solid;
pub mod straight;
pub mod stroke;
pub mod style;
pub mod subject;
pub mod surface;
pub mod trace;
pub mod trilinear;
pub mod voxel;
