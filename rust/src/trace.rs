//! Lines of pixels as strokes: thinned, followed from junction to junction, cut at corners, and smoothed.

use crate::camera::IMAGE;

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

/// Rows are a border longer on both sides, so that every pixel has eight neighbours.
const STRIDE: usize = IMAGE + 2;
/// From one pixel to its neighbours: east, south-east, and so on round.
const AROUND: [isize; 8] = {
    let s = STRIDE as isize;
    [1, s + 1, s, s - 1, -1, -s - 1, -s, 1 - s]
};
/// A line turns by more than this (its cosine squared, 50 degrees) within so many pixels on either side of a corner.
const CORNER: i64 = 413;
const CORNER_REACH: usize = 5;
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

/// Makes the lines of a drawing [256, 256] one pixel wide, and takes away what then has fewer pixels than `least`.
pub fn thin(ink: &mut [u8], least: usize) {
    let mut pixels = Pixels::of(ink, 1);
    pixels.thin();
    ink.fill(0);
    for &start in &pixels.places {
        // What hangs together with it and was not found before.
        let mut piece = Vec::new();
        let mut next = vec![start];
        while let Some(place) = next.pop() {
            if std::mem::take(&mut pixels.ink[place]) > 0 {
                piece.push(place);
                next.extend(AROUND.map(|by| place.wrapping_add_signed(by)));
            }
        }
        if piece.len() >= least {
            for [x, y] in piece.into_iter().map(point) {
                ink[y as usize * IMAGE + x as usize] = 255;
            }
        }
    }
}

/// The pixels of lines, with a border around.
struct Pixels {
    ink: Vec<u8>,
    /// Those with ink, from the first row to the last.
    places: Vec<usize>,
}

/// Pixels in a line, one after the other, and the junctions that it runs between; `None` at an end that is free.
struct Path {
    pixels: Vec<[i32; 2]>,
    ends: [Option<usize>; 2],
}

impl Path {
    fn closed(&self) -> bool {
        self.pixels.len() > 2 && self.pixels.first() == self.pixels.last()
    }
}

/// Which neighbourhoods of a pixel let it go when lines are thinned: nothing comes apart, no end gets shorter, and no
/// junction or corner of straight lines is cut.
const SPARE: [bool; 256] = {
    let mut spare = [false; 256];
    let mut code = 0;
    while code < 256 {
        // Yokoi's number: the pieces that the neighbourhood falls into without its middle.
        let mut pieces = 0;
        let mut k = 0;
        while k < 8 {
            pieces += blank_at(code, k) - blank_at(code, k) * blank_at(code, k + 1) * blank_at(code, k + 2);
            k += 2;
        }
        let code8 = code as u8;
        spare[code] = pieces == 1 && code8.count_ones() >= 2 && code8 & 0b1010_1010 != 0;
        code += 1;
    }
    spare
};

const fn blank_at(code: usize, i: usize) -> usize {
    1 - (code >> (i % 8) & 1)
}

/// For each neighbourhood, the neighbours that a line goes on to: a diagonal one beside a straight one is the same way
/// round a bend.
const LINKS: [u8; 256] = {
    let mut links = [0; 256];
    let mut code = 0;
    while code < 256 {
        let mut k = 0;
        while k < 8 {
            let beside = blank_at(code, k + 1) == 0 || blank_at(code, k + 7) == 0;
            if blank_at(code, k) == 0 && (k % 2 == 0 || !beside) {
                links[code] |= 1 << k;
            }
            k += 1;
        }
        code += 1;
    }
    links
};

impl Pixels {
    fn of(drawing: &[u8], least: u8) -> Self {
        let mut ink = vec![0; STRIDE * STRIDE];
        let mut places = Vec::with_capacity(4096);
        for (row, line) in drawing.as_chunks::<IMAGE>().0.iter().enumerate() {
            for (part, bytes) in line.as_chunks::<16>().0.iter().enumerate() {
                if u128::from_ne_bytes(*bytes) == 0 {
                    continue;
                }
                for (i, &byte) in bytes.iter().enumerate() {
                    if byte >= least && byte > 0 {
                        let place = (row + 1) * STRIDE + 16 * part + i + 1;
                        ink[place] = 1;
                        places.push(place);
                    }
                }
            }
        }
        let mut pixels = Self { ink, places };
        pixels.close();
        pixels
    }

    /// Fills holes of one pixel: slanted lines so near each other that they touch everywhere are one.
    fn close(&mut self) {
        let hole = |&p: &usize| {
            self.ink[p] == 0 && [p + 1, p - STRIDE, p + STRIDE].iter().all(|&beside| self.ink[beside] == 1)
        };
        let holes: Vec<usize> = self.places.iter().map(|p| p + 1).filter(hole).collect();
        if !holes.is_empty() {
            holes.iter().for_each(|&p| self.ink[p] = 1);
            self.places.extend(holes);
            self.places.sort_unstable();
        }
    }

    #[inline(always)]
    fn around(&self, place: usize) -> usize {
        let at = |k: usize| usize::from(self.ink[place.wrapping_add_signed(AROUND[k])]) << k;
        at(0) | at(1) | at(2) | at(3) | at(4) | at(5) | at(6) | at(7)
    }

    /// Takes pixels away, from one side after the other, until lines are one pixel wide.
    fn thin(&mut self) {
        let mut wide: Vec<usize> = self.places.iter().copied().filter(|&p| SPARE[self.around(p)]).collect();
        let mut taken = false;
        while !wide.is_empty() {
            let mut next = Vec::new();
            for side in [6, 2, 0, 4] {
                let open = |p: &usize| self.ink[p.wrapping_add_signed(AROUND[side])] == 0;
                let border: Vec<usize> = wide.iter().copied().filter(open).collect();
                for place in border {
                    if self.ink[place] == 1 && SPARE[self.around(place)] {
                        self.ink[place] = 0;
                        taken = true;
                        let beside = AROUND.iter().map(|&by| place.wrapping_add_signed(by));
                        next.extend(beside.filter(|&p| self.ink[p] == 1));
                    }
                }
            }
            next.retain(|&p| self.ink[p] == 1 && SPARE[self.around(p)]);
            next.sort_unstable();
            next.dedup();
            wide = next;
        }
        if taken {
            let ink = &self.ink;
            self.places.retain(|&p| ink[p] == 1);
        }
    }

    /// The lines from end or junction to end or junction; then those that close on themselves.
    fn paths(&mut self) -> Vec<Path> {
        // From here on `ink` holds the ways on from each pixel that were not gone yet.
        let links: Vec<u8> = self.places.iter().map(|&p| LINKS[self.around(p)]).collect();
        let mut ways = std::mem::take(&mut self.ink);
        for (&place, &link) in self.places.iter().zip(&links) {
            ways[place] = link;
        }
        let is_node = |link: u8| link.count_ones() != 2;
        let nodes: Vec<usize> =
            self.places.iter().zip(&links).filter(|&(_, &l)| is_node(l)).map(|(&p, _)| p).collect();
        let junctions: Vec<usize> =
            self.places.iter().zip(&links).filter(|&(_, &l)| l.count_ones() > 2).map(|(&p, _)| p).collect();
        let clusters = clusters(&junctions);
        let cluster = |p: usize| junctions.binary_search(&p).ok().map(|i| clusters[i]);
        let mut paths = Vec::new();
        let starts = nodes.iter().map(|&n| (n, true)).chain(self.places.iter().map(|&p| (p, false)));
        for (start, node) in starts {
            while ways[start] != 0 {
                let mut pixels = vec![point(start)];
                let (mut place, mut way) = (start, ways[start].trailing_zeros() as usize);
                loop {
                    ways[place] &= !(1 << way);
                    place = place.wrapping_add_signed(AROUND[way]);
                    ways[place] &= !(1 << ((way + 4) % 8));
                    pixels.push(point(place));
                    if place == start || nodes.binary_search(&place).is_ok() || ways[place] == 0 {
                        break;
                    }
                    way = ways[place].trailing_zeros() as usize;
                }
                let ends = if node { [cluster(start), cluster(place)] } else { [None; 2] };
                // What lies within a junction is no line.
                if ends[0].is_none() || ends[0] != ends[1] || pixels.len() > 4 {
                    paths.push(Path { pixels, ends });
                }
            }
        }
        paths
    }
}

fn point(place: usize) -> [i32; 2] {
    [(place % STRIDE) as i32 - 1, (place / STRIDE) as i32 - 1]
}

/// For each junction pixel, in ascending order, the first of those that it hangs together with.
fn clusters(junctions: &[usize]) -> Vec<usize> {
    let mut first: Vec<usize> = (0..junctions.len()).collect();
    // Neighbours before a pixel, in the order of the pixels; twice, for those that meet later.
    for _ in 0..2 {
        for i in 0..junctions.len() {
            for by in AROUND {
                if let Ok(j) = junctions.binary_search(&junctions[i].wrapping_add_signed(by)) {
                    let least = first[i].min(first[j]);
                    (first[i], first[j]) = (least, least);
                }
            }
        }
    }
    first
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
                Some(last) if i - last.0 <= CORNER_REACH => {
                    if cosine < last.1 {
                        *last = (i, cosine);
                    }
                }
                _ => found.push((i, cosine)),
            }
        }
    }
    if let (true, [first, .., last]) = (closed, &found[..])
        && first.0 + round - last.0 <= CORNER_REACH
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

/// A point every so many pixels: on the straight line between the ends where all pixels are near it, else averaged.
fn smoothed(pixels: &[[i32; 2]], step: usize, closed: bool) -> Vec<Point> {
    let last = pixels.len() - 1;
    let to_point = |[x, y]: [i32; 2]| [x as f32, y as f32];
    let (a, b) = (to_point(pixels[0]), to_point(pixels[last]));
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let long = (dx * dx + dy * dy).sqrt();
    let count = last.div_ceil(step).max(1);
    let strays =
        |p: &[i32; 2]| ((p[0] as f32 - a[0]) * dy - (p[1] as f32 - a[1]) * dx).abs() > STRAIGHT * long;
    if !closed && !pixels.iter().any(strays) {
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
mod tests {
    use super::*;

    const FINE: TraceConfig = TraceConfig { step: 1, through: false };

    fn with_ink(inked: impl Fn(i32, i32) -> bool) -> Vec<u8> {
        (0..IMAGE * IMAGE)
            .map(|i| if inked((i % IMAGE) as i32, (i / IMAGE) as i32) { 255 } else { 0 })
            .collect()
    }

    #[test]
    fn a_square_has_four_sides_that_meet_at_its_corners() {
        let on = |x: i32, y: i32| (60..=180).contains(&x) && (60..=180).contains(&y);
        let inner = |x: i32, y: i32| (61..180).contains(&x) && (61..180).contains(&y);
        let strokes = trace(&with_ink(|x, y| on(x, y) && !inner(x, y)), 64, FINE);
        assert_eq!(strokes.len(), 4);
        for stroke in &strokes {
            assert_eq!(stroke.points.len(), 121);
            for end in [stroke.points[0], stroke.points[120]] {
                assert!(end.iter().all(|&v| v == 60.0 || v == 180.0), "{end:?}");
            }
        }
    }

    #[test]
    fn a_thick_disc_ring_is_one_closed_line() {
        let strokes = trace(
            &with_ink(|x, y| {
                let d = (x - 128).pow(2) + (y - 120).pow(2);
                (58 * 58..62 * 62).contains(&d)
            }),
            64,
            FINE,
        );
        assert_eq!(strokes.len(), 1);
        assert!(strokes[0].closed && strokes[0].points.first() == strokes[0].points.last());
        for [x, y] in &strokes[0].points {
            assert!(((x - 128.0).hypot(y - 120.0) - 60.0).abs() < 1.5);
        }
    }

    #[test]
    fn lines_go_on_through_crossings_if_asked() {
        let cross =
            with_ink(|x, y| (y == 128 && (50..200).contains(&x)) || (x == 120 && (40..220).contains(&y)));
        assert_eq!(trace(&cross, 64, FINE).len(), 4);
        let strokes = trace(&cross, 64, TraceConfig { step: 2, through: true });
        assert_eq!(strokes.len(), 2);
        let tee =
            with_ink(|x, y| (y == 128 && (50..200).contains(&x)) || (x == 120 && (128..220).contains(&y)));
        let strokes = trace(&tee, 64, TraceConfig { step: 2, through: true });
        assert_eq!(strokes.len(), 2);
    }

    #[test]
    fn slanted_lines_that_touch_everywhere_are_one() {
        let strokes = trace(
            &with_ink(|x, y| (50..150).contains(&y) && (x == y || x == y + 2)),
            64,
            TraceConfig { step: 1, through: true },
        );
        let long: usize = strokes.iter().map(|s| s.points.len()).sum();
        assert!((95..=110).contains(&long), "{long}");
    }

    #[test]
    fn nothing_and_everything_can_be_traced() {
        assert!(trace(&[0; IMAGE * IMAGE], 64, FINE).is_empty());
        let all = trace(&[255; IMAGE * IMAGE], 64, FINE);
        assert!(all.iter().flat_map(|s| &s.points).flatten().all(|v| v.is_finite()));
    }
}
