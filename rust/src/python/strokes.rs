//! Styles, and drawings as strokes.

use super::arrays::{camera_of, checked, filled, shape_of};
use crate::batch::SampleConfig;
use crate::buffers::Buffers;
use crate::camera::IMAGE;
use crate::error::CoreError;
use crate::kinds::{self, Kinds};
use crate::random::Random;
use crate::style::LineStyle;
use crate::trace::TraceConfig;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

/// Streams of a style's random numbers that a seed has.
const JITTER: u64 = 0;
const STROKES: u64 = 1;

#[pyfunction]
pub fn check_style(style: &str) -> PyResult<()> {
    Ok(LineStyle::from_json(style).map(drop)?)
}

/// A style drawn from the ranges of a generator's `styles`, as JSON.
#[pyfunction]
pub fn random_style(ranges: &str, seed: u64) -> PyResult<String> {
    let config = SampleConfig::from_json(&format!("{{\"styles\": {ranges}}}"))?;
    let style = config.styles.draw(&mut Random::new(seed, 0, JITTER));
    Ok(serde_json::to_string(&style).expect("a style is plain data"))
}

/// The camera that a drawing in a style is really made from, float64 [15].
#[pyfunction]
pub fn style_camera<'py>(
    py: Python<'py>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    style: &str,
    seed: u64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (camera, style) = (camera_of(&camera)?, LineStyle::from_json(style)?);
    let camera = style.camera(&camera, &mut Random::new(seed, 0, JITTER));
    Ok(camera.to_packed().to_vec().into_pyarray(py))
}

/// A drawing traced, and drawn again in a style.
#[pyfunction]
#[pyo3(signature = (drawing, style, seed, out=None))]
pub fn redraw<'py>(
    py: Python<'py>,
    drawing: PyReadonlyArrayDyn<'py, u8>,
    style: &str,
    seed: u64,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let style = LineStyle::from_json(style)?;
    let pixels = checked(&drawing, "drawing", &[IMAGE as isize; 2])?.to_vec();
    // It may be written into.
    drop(drawing);
    filled(py, out, &[IMAGE; 2], |out| {
        crate::stroke::redraw(&pixels, &style, &mut Random::new(seed, 0, STROKES), out);
        Ok::<_, CoreError>(())
    })
}

/// The strokes of a drawing, float32 [n, 2] each, points `step` pixels apart.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    drawing: PyReadonlyArrayDyn<'py, u8>,
    least: u8,
    step: usize,
    through: bool,
) -> PyResult<Vec<Bound<'py, PyArray2<f32>>>> {
    let drawing = checked(&drawing, "drawing", &[IMAGE as isize; 2])?;
    let config = TraceConfig { step: step.max(1), through };
    let strokes = py.detach(|| crate::trace::trace(drawing, least, config));
    strokes
        .into_iter()
        .map(|stroke| {
            let count = stroke.points.len();
            stroke.points.into_flattened().into_pyarray(py).reshape([count, 2])
        })
        .collect()
}

/// The straight pieces of a drawing's lines, float64 [n, 5]: both ends (x, y), a pixel's centre half a pixel from its
/// edges, and by how much it bends.
#[pyfunction]
pub fn straight<'py>(
    py: Python<'py>,
    drawing: PyReadonlyArrayDyn<'py, u8>,
    least: u8,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let drawing = checked(&drawing, "drawing", &[IMAGE as isize; 2])?;
    let pieces = py.detach(|| crate::straight::straight(drawing, least));
    let count = pieces.len();
    let rows: Vec<f64> = pieces
        .iter()
        .flat_map(|p| [p.ends[0][0], p.ends[0][1], p.ends[1][0], p.ends[1][1], p.bend])
        .collect();
    rows.into_pyarray(py).reshape([count, 5])
}

/// The pixels of lines behind the first surface, uint8 [256, 256].
#[pyfunction]
pub fn hidden_lines<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    py.detach(|| kinds::hidden_lines(&shape, &camera))?.into_pyarray(py).reshape([IMAGE, IMAGE])
}

/// Lines of some kinds, in a style.
#[pyfunction]
#[pyo3(signature = (depth, normal, camera, hidden, lines, style, seed, out=None))]
#[expect(clippy::too_many_arguments, reason = "all that a drawing depends on, each by name")]
pub fn draw_kinds<'py>(
    py: Python<'py>,
    depth: PyReadonlyArrayDyn<'py, f32>,
    normal: PyReadonlyArrayDyn<'py, f32>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    hidden: Option<PyReadonlyArrayDyn<'py, u8>>,
    lines: Vec<String>,
    style: &str,
    seed: u64,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let side = IMAGE as isize;
    let depth = checked(&depth, "depth", &[side, side])?.to_vec();
    let normal = checked(&normal, "normal", &[side, side, 3])?.as_chunks::<3>().0.to_vec();
    let seen = Buffers { depth, normal, size: IMAGE };
    let hidden = hidden.as_ref().map(|h| checked(h, "hidden", &[side, side])).transpose()?;
    let (camera, style) = (camera_of(&camera)?, LineStyle::from_json(style)?);
    let kinds = Kinds::of(lines.iter().map(String::as_str))?;
    filled(py, out, &[IMAGE; 2], |out| {
        kinds::draw(&seen, &camera, hidden, kinds, &style, &mut Random::new(seed, 0, STROKES), out);
        Ok::<_, CoreError>(())
    })
}
