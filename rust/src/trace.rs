//! Lines of pixels as strokes: thinned, followed from junction to junction, cut at corners, and smoothed.

mod pixels;

use crate::camera::IMAGE;
use pixels::Path;
use pixels::Pixels;
pub use pixels::thin;

/// A point in pixels, x to the right, y down; a pixel's centre is at its indices.
pub type Point = [f32; 2];

/// A line as a pen draws it, in one go.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// At least two; a closed one's last is its first.
    pub points: Vec<Point>,
    pub closed: bool,
}

/// How finely to trace.
#[derive(Clone, Copy, Debug)]
pub struct TraceConfig {
    /// Pixels from point to point.
    pub step: usize,
    /// Whether a line goes on through junctions, as long as it goes straight on.
    pub through: bool,
}

/// A line turns by more than this (its cosine squared, 50 degrees) within so many pixels on either side of a corner.
const CORNER: i64 = 413;
const CORNER_REACH: usize = 5;
/// Sharp turns so many pixels apart are one corner.
const SAME_CORNER: usize = 3;
/// Pixels of a straight line are nearer to it than this.
const STRAIGHT: f32 = 0.85;
/// Lines are smoothed over so many pixels on either side.
const SMOOTH: usize = 4;
/// Lines whose directions differ by less than 25 degrees go on through a junction; measured over so many pixels.
const GOES_ON: f32 = -0.906;
const ON_REACH: usize = 8;

/// The strokes of a drawing [256, 256] whose ink is `least` or more; they do not depend on how dark it is.
pub fn trace(drawing: &[u8], least: u8, config: TraceConfig) -> Vec<Stroke> {
    assert_eq!(drawing.len(), IMAGE * IMAGE);
    let mut pixels = Pixels::of(drawing, least);
    pixels.thin();
    let mut paths = pixels.paths();
    if config.through {
        paths = joined(paths);
    }
    let mut strokes = Vec::with_capacity(2 * paths.len());
    for path in &paths {
        cut(path, config.step, &mut strokes);
    }
    strokes
}

/// Lines made one where one goes straight on as the other through a junction.
fn joined(paths: Vec<Path>) -> Vec<Path> {
    // The ends that meet at each junction: path, side, and the direction away from it.
    let mut meeting: Vec<(usize, usize, usize, Point)> = Vec::new();
    for (index, path) in paths.iter().enumerate() {
        for side in 0..2 {
            if let Some(junction) = path.ends[side].filter(|_| path.pixels.len() > 3) {
                let last = path.pixels.len() - 1;
                let reach = ON_REACH.min(last);
                let pick = |k: usize| path.pixels[if side == 0 { k } else { last - k }];
                let ([x, y], [u, v]) = (pick(0), pick(reach));
                let (dx, dy) = ((u - x) as f32, (v - y) as f32);
                let long = (dx * dx + dy * dy).sqrt();
                if long > 0.0 {
                    meeting.push((junction, index, side, [dx / long, dy / long]));
                }
            }
        }
    }
    meeting.sort_by_key(|&(junction, index, side, _)| (junction, index, side));
    let mut partner: Vec<[Option<(usize, usize)>; 2]> = vec![[None; 2]; paths.len()];
    for ends in meeting.chunk_by(|a, b| a.0 == b.0) {
        let mut pairs = Vec::new();
        for (i, a) in ends.iter().enumerate() {
            for b in &ends[i + 1..] {
                let cosine = a.3[0] * b.3[0] + a.3[1] * b.3[1];
                if cosine < GOES_ON && a.1 != b.1 {
                    pairs.push((cosine, (a.1, a.2), (b.1, b.2)));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, a, b) in pairs {
            if partner[a.0][a.1].is_none() && partner[b.0][b.1].is_none() {
                (partner[a.0][a.1], partner[b.0][b.1]) = (Some(b), Some(a));
            }
        }
    }
    let mut paths: Vec<Option<Path>> = paths.into_iter().map(Some).collect();
    let mut result = Vec::with_capacity(paths.len());
    // Chains from their ends; then those that have none.
    for round in 0..2 {
        for start in 0..paths.len() {
            let side = match partner[start] {
                [None, _] => 0,
                [_, None] => 1,
                _ if round == 1 => 0,
                _ => continue,
            };
            let Some(mut chain) = paths[start].take() else { continue };
            if side == 1 {
                chain.pixels.reverse();
                chain.ends.reverse();
            }
            let mut leaving = partner[start][1 - side];
            while let Some((next, entered)) = leaving {
                let Some(mut path) = paths[next].take() else { break };
                if entered == 1 {
                    path.pixels.reverse();
                    path.ends.reverse();
                }
                let skip = usize::from(path.pixels[0] == chain.pixels[chain.pixels.len() - 1]);
                chain.pixels.extend(&path.pixels[skip..]);
                chain.ends[1] = path.ends[1];
                leaving = partner[next][1 - entered];
            }
            result.push(chain);
        }
    }
    result
}

/// Cuts a line at its corners, and smooths each part.
fn cut(path: &Path, step: usize, strokes: &mut Vec<Stroke>) {
    let closed = path.closed();
    let mut pixels = path.pixels.clone();
    let mut corners = corners(&pixels, closed);
    if closed && !corners.is_empty() {
        // Begins at a corner, so that none is where it happened to be found.
        pixels.pop();
        pixels.rotate_left(corners[0]);
        pixels.push(pixels[0]);
        let first = corners[0];
        corners.iter_mut().for_each(|c| *c -= first);
        corners.remove(0);
    } else if closed {
        strokes.push(Stroke { points: smoothed(&pixels, step, true), closed: true });
        return;
    }
    let mut from = 0;
    for to in corners.into_iter().chain([pixels.len() - 1]) {
        if to > from {
            strokes.push(Stroke { points: smoothed(&pixels[from..=to], step, false), closed: false });
        }
        from = to;
    }
}

/// Where a line of pixels turns sharply, in ascending order.
fn corners(pixels: &[[i32; 2]], closed: bool) -> Vec<usize> {
    let (n, mut found) = (pixels.len(), Vec::<(usize, f32)>::new());
    let round = if closed { n - 1 } else { n };
    if n < 8 {
        return Vec::new();
    }
    let range = if closed { 0..n - 1 } else { 3..n - 3 };
    for i in range {
        let reach = if closed { CORNER_REACH.min(round / 4) } else { CORNER_REACH.min(i).min(n - 1 - i) };
        let (a, b, c) = (
            pixels[(i + round - reach) % round],
            pixels[i],
            pixels[if closed { (i + reach) % round } else { i + reach }],
        );
        let (ux, uy) = (i64::from(b[0] - a[0]), i64::from(b[1] - a[1]));
        let (vx, vy) = (i64::from(c[0] - b[0]), i64::from(c[1] - b[1]));
        let dot = ux * vx + uy * vy;
        let lengths = (ux * ux + uy * uy) * (vx * vx + vy * vy);
        if dot <= 0 || 1000 * dot * dot < CORNER * lengths {
            let cosine = dot as f32 / (lengths as f32).sqrt().max(1e-6);
            match found.last_mut() {
                Some(last) if i - last.0 <= SAME_CORNER => {
                    if cosine < last.1 {
                        *last = (i, cosine);
                    }
                }
                _ => found.push((i, cosine)),
            }
        }
    }
    if let (true, [first, .., last]) = (closed, &found[..])
        && first.0 + round - last.0 <= SAME_CORNER
    {
        // One corner, on both sides of where the line was begun.
        if first.1 <= last.1 {
            found.pop();
        } else {
            found.remove(0);
        }
    }
    found.into_iter().map(|(i, _)| i).collect()
}

/// A point every so many pixels: on the straight line between the ends where all pixels are near it, else averaged. A
/// line that ends where it begins goes along none.
fn smoothed(pixels: &[[i32; 2]], step: usize, closed: bool) -> Vec<Point> {
    let last = pixels.len() - 1;
    let to_point = |[x, y]: [i32; 2]| [x as f32, y as f32];
    let (a, b) = (to_point(pixels[0]), to_point(pixels[last]));
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let long = (dx * dx + dy * dy).sqrt();
    let count = last.div_ceil(step).max(1);
    let strays =
        |p: &[i32; 2]| ((p[0] as f32 - a[0]) * dy - (p[1] as f32 - a[1]) * dx).abs() > STRAIGHT * long;
    if long > 0.0 && !pixels.iter().any(strays) {
        let at = |k: usize| k as f32 / count as f32;
        return (0..=count).map(|k| [a[0] + at(k) * dx, a[1] + at(k) * dy]).collect();
    }
    if closed {
        // Averages go on past the end, from the beginning.
        let mut around = pixels[last - SMOOTH.min(last)..last].to_vec();
        let before = around.len();
        around.extend(pixels);
        around.extend(&pixels[1..=SMOOTH.min(last)]);
        let mut points: Vec<Point> =
            (0..count).map(|k| average(&around, before + k * last / count, SMOOTH.min(last))).collect();
        points.push(points[0]);
        return points;
    }
    (0..=count)
        .map(|k| {
            let i = k * last / count;
            average(pixels, i, SMOOTH.min(i).min(last - i))
        })
        .collect()
}

#[inline(always)]
fn average(pixels: &[[i32; 2]], at: usize, reach: usize) -> Point {
    let (mut x, mut y) = (0, 0);
    for p in &pixels[at - reach..=at + reach] {
        (x, y) = (x + p[0], y + p[1]);
    }
    let count = (2 * reach + 1) as f32;
    [x as f32 / count, y as f32 / count]
}

#[cfg(test)]
mod tests;
