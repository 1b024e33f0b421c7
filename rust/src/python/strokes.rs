//! Styles, and drawings as strokes.

use super::arrays::{all_finite, camera_of, checked, filled};
use crate::batch::SampleConfig;
use crate::brush::{self, Dab};
use crate::camera::IMAGE;
use crate::error::CoreError;
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

/// Strokes drawn by a round pen of one width, uint8 [256, 256].
#[pyfunction]
pub fn render<'py>(
    py: Python<'py>,
    strokes: Vec<PyReadonlyArrayDyn<'py, f32>>,
    width: f32,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let mut pens = Vec::with_capacity(strokes.len());
    for stroke in &strokes {
        let points = checked(stroke, "a stroke", &[-1, 2])?;
        all_finite(points, "a stroke")?;
        pens.push(
            points.as_chunks::<2>().0.iter().map(|&at| Dab { at, width, ink: 1.0 }).collect::<Vec<_>>(),
        );
    }
    filled(py, None, &[IMAGE; 2], |out| {
        pens.iter().for_each(|dabs| brush::draw(dabs, true, out));
        Ok::<_, CoreError>(())
    })
}
