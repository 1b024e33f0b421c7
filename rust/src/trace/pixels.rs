//! The pixels of lines: thinned, and followed from junction to junction.

use crate::camera::IMAGE;

/// Rows are a border longer on both sides, so that every pixel has eight neighbours.
const STRIDE: usize = IMAGE + 2;
/// From one pixel to its neighbours: east, south-east, and so on round.
const AROUND: [isize; 8] = {
    let s = STRIDE as isize;
    [1, s + 1, s, s - 1, -1, -s - 1, -s, 1 - s]
};
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
pub struct Pixels {
    ink: Vec<u8>,
    /// Those with ink, from the first row to the last.
    places: Vec<usize>,
}

/// Pixels in a line, one after the other, and the junctions that it runs between; `None` at an end that is free.
pub struct Path {
    pub pixels: Vec<[i32; 2]>,
    pub ends: [Option<usize>; 2],
}

impl Path {
    pub fn closed(&self) -> bool {
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
    pub fn of(drawing: &[u8], least: u8) -> Self {
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
    pub fn thin(&mut self) {
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
    pub fn paths(&mut self) -> Vec<Path> {
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
