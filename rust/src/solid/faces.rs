//! What it takes to follow rays across faces, worked out for many faces side by side.

use super::crossings::{HALF, ONE, Point, ROUND};

/// So many faces at a time.
pub const FACES: usize = 64;
pub type Each<T> = [T; FACES];
/// Rays across a face's patch: most faces of a fine mesh are smaller.
pub const PATCH: usize = 3;
/// What `Faces::met` says of a face that is too large for a patch.
pub const ALONE: u64 = u64::MAX;

/// Corners of faces, axis by axis; those of a face that is not there are 0.
pub struct Corners {
    a: [Each<i32>; 3],
    b: [Each<i32>; 3],
    c: [Each<i32>; 3],
    /// The corners' random numbers.
    random: [Each<i32>; 3],
}

/// How rays cross faces. A face is seen from the side from which it runs anticlockwise: `b` and `c` change places where
/// need be. Its edges lie opposite to `a`, `b` and `c`.
pub struct Faces {
    pub corners: Corners,
    /// The columns whose rays pass the bounding box of a face, along either axis; where there are none, or the face
    /// stands upright, `last` of the first axis is -1.
    pub first: [Each<i32>; 2],
    pub last: [Each<i32>; 2],
    /// Twice the area as seen from above; more than 0 where the face's outside is.
    pub area: Each<i64>,
    /// How far the first column's ray lies within each edge, times its length; less than 0 outside. On the edge it is
    /// 0 if the edge keeps its rays, else -1.
    pub margins: [Each<i64>; 3],
    /// How the margins grow from column to column.
    pub steps: [[Each<i64>; 2]; 3],
    /// The height of the plane above the first column, in voxels, and how it grows.
    pub height: Each<f64>,
    pub slopes: [Each<f64>; 2],
    /// Rounding leaves less than a thousandth of this in a height.
    pub unsure: Each<f64>,
    /// Which rays of its patch a face meets: bit `3 i + j` stands for the ray i columns on along the first axis and j
    /// along the second; or `ALONE`.
    pub met: Each<u64>,
}

impl Default for Faces {
    fn default() -> Self {
        let none = [[0; FACES]; 3];
        Self {
            corners: Corners { a: none, b: none, c: none, random: none },
            first: [[0; FACES]; 2],
            last: [[0; FACES]; 2],
            area: [0; FACES],
            margins: [[0; FACES]; 3],
            steps: [[[0; FACES]; 2]; 3],
            height: [0.0; FACES],
            slopes: [[0.0; FACES]; 2],
            unsure: [0.0; FACES],
            met: [0; FACES],
        }
    }
}

impl Faces {
    /// Prepares up to `FACES` faces; returns the sum over their edges that says whether they close (`Crossings::closed`).
    #[inline(always)]
    pub fn prepare(&mut self, points: &[Point], faces: &[[i64; 3]]) -> i64 {
        self.corners.gather(points, faces);
        self.measure();
        self.meet();
        self.corners.boundary()
    }

    #[inline(always)]
    fn measure(&mut self) {
        let Self { corners, first, last, area, margins, steps, height, slopes, unsure, .. } = self;
        for i in 0..FACES {
            let [a, b, c] = [&corners.a, &corners.b, &corners.c].map(|p| [p[0][i], p[1][i], p[2][i]]);
            let mut empty = false;
            for axis in 0..2 {
                let low = a[axis].min(b[axis]).min(c[axis]);
                let high = a[axis].max(b[axis]).max(c[axis]);
                first[axis][i] = column_from(low);
                last[axis][i] = column_to(high);
                empty |= first[axis][i] > last[axis][i];
            }
            let signed = along(a, b, 0) * along(a, c, 1) - along(a, b, 1) * along(a, c, 0);
            area[i] = signed;
            last[0][i] = if empty | (signed == 0) { -1 } else { last[0][i] };
            let [b, c] = if signed < 0 { [c, b] } else { [b, c] };
            let at = [first[0][i], first[1][i]].map(|column| column * ONE + HALF);
            for (edge, [p, q]) in [[b, c], [c, a], [a, b]].into_iter().enumerate() {
                let [dx, dy] = [along(p, q, 0), along(p, q, 1)];
                let [x, y] = [0, 1].map(|axis| i64::from(at[axis] - p[axis]));
                margins[edge][i] = dx * y - dy * x - i64::from(!keeps(dx, dy));
                steps[edge][0][i] = -dy * i64::from(ONE);
                steps[edge][1][i] = dx * i64::from(ONE);
            }
            let [rise_b, rise_c] = [along(a, b, 2), along(a, c, 2)];
            let share = 1.0 / signed.abs() as f64;
            let slope_x = (along(a, c, 1) * rise_b - along(a, b, 1) * rise_c) as f64 * share;
            let slope_y = (along(a, b, 0) * rise_c - along(a, c, 0) * rise_b) as f64 * share;
            let [from_x, from_y] = [0, 1].map(|axis| f64::from(at[axis] - a[axis]));
            height[i] =
                (f64::from(a[2] - HALF) + slope_x * from_x + slope_y * from_y) * (1.0 / f64::from(ONE));
            (slopes[0][i], slopes[1][i]) = (slope_x, slope_y);
            unsure[i] = 1e-10 * (1.0 + slope_x.abs() + slope_y.abs());
        }
    }

    /// Which rays of their patches the faces meet.
    #[inline(always)]
    fn meet(&mut self) {
        let Self { first, last, margins, steps, met, .. } = self;
        for i in 0..FACES {
            let [x, y] = [0, 1].map(|axis| [0, 1, 2].map(|edge: usize| steps[edge][axis][i]));
            let mut row = [0, 1, 2].map(|edge: usize| margins[edge][i]);
            let mut outside = 0;
            for column in 0..PATCH {
                let mut margin = row;
                for ray in 0..PATCH {
                    outside |= ((margin[0] | margin[1] | margin[2]) as u64 >> 63) << (PATCH * column + ray);
                    margin = [0, 1, 2].map(|edge| margin[edge] + y[edge]);
                }
                row = [0, 1, 2].map(|edge| row[edge] + x[edge]);
            }
            let reach = PATCH as i32 - 1;
            let large = (last[0][i] - first[0][i] > reach) | (last[1][i] - first[1][i] > reach);
            let seen = if large { ALONE } else { !outside & ((1 << (PATCH * PATCH)) - 1) };
            met[i] = if last[0][i] < 0 { 0 } else { seen };
        }
    }

    /// Calls `add` with each ray that a face meets, counted from its first column.
    #[inline(always)]
    pub fn each_ray(&self, face: usize, mut add: impl FnMut(usize, usize)) {
        let steps = self.steps.each_ref().map(|[x, y]| [x[face], y[face]]);
        let mut row = self.margins.each_ref().map(|margin| margin[face]);
        let [rows, columns] = [0, 1].map(|axis| (self.last[axis][face] - self.first[axis][face]) as usize);
        for i in 0..=rows {
            let mut margins = row;
            for j in 0..=columns {
                if margins[0] | margins[1] | margins[2] >= 0 {
                    add(i, j);
                }
                margins.iter_mut().zip(steps).for_each(|(margin, [_, y])| *margin += y);
            }
            row.iter_mut().zip(steps).for_each(|(margin, [x, _])| *margin += x);
        }
    }

    /// The first voxel of a column whose centre is not below a face; in the lowest six bits, if there is one. The
    /// column lies `i` columns on from the first along the first axis, and `j` along the second.
    #[inline(always)]
    pub fn first_above(&self, face: usize, i: usize, j: usize) -> u32 {
        let height = self.height[face] + self.slopes[0][face] * i as f64 + self.slopes[1][face] * j as f64;
        let (first, over) = rounded_up(height);
        if over < self.unsure[face] { self.first_above_exactly(face, i, j) } else { first }
    }

    #[cold]
    fn first_above_exactly(&self, face: usize, i: usize, j: usize) -> u32 {
        let [a, mut b, mut c] =
            [&self.corners.a, &self.corners.b, &self.corners.c].map(|p| [p[0][face], p[1][face], p[2][face]]);
        if self.area[face] < 0 {
            std::mem::swap(&mut b, &mut c);
        }
        // The areas that b and c have of the face where the ray meets it.
        let share = |edge: usize, p, q| {
            let [x, y] = [self.steps[edge][0][face] * i as i64, self.steps[edge][1][face] * j as i64];
            self.margins[edge][face] + x + y + i64::from(!keeps(along(p, q, 0), along(p, q, 1)))
        };
        let [share_b, share_c] = [share(1, c, a), share(2, a, b)].map(i128::from);
        let [rise_b, rise_c] = [along(a, b, 2), along(a, c, 2)].map(i128::from);
        let area = i128::from(self.area[face].abs());
        let height = share_b * rise_b + share_c * rise_c + i128::from(a[2] - HALF) * area;
        -(-height).div_euclid(area * i128::from(ONE)) as u32
    }
}

impl Corners {
    #[inline(always)]
    fn gather(&mut self, points: &[Point], faces: &[[i64; 3]]) {
        let Self { a, b, c, random } = self;
        for i in 0..FACES {
            let corners = faces.get(i).map_or([Point::default(); 3], |face| face.map(|j| points[j as usize]));
            for (k, (to, corner)) in [&mut *a, &mut *b, &mut *c].into_iter().zip(corners).enumerate() {
                (to[0][i], to[1][i], to[2][i], random[k][i]) = (corner[0], corner[1], corner[2], corner[3]);
            }
        }
    }

    #[inline(always)]
    fn boundary(&self) -> i64 {
        let mut sum = 0_i64;
        for i in 0..FACES {
            let [p, q, r] = [0, 1, 2].map(|k| i64::from(self.random[k][i]));
            sum = sum.wrapping_add((p - q).wrapping_mul(q - r).wrapping_mul(r - p));
        }
        sum
    }
}

/// The least integer that is not below a height, in the low bits; and how far from an integer the height is.
#[inline(always)]
fn rounded_up(height: f64) -> (u32, f64) {
    let rounded = height + ROUND;
    let over = height - (rounded - ROUND);
    (rounded.to_bits() as u32 + u32::from(over > 0.0), over.abs())
}

/// The first column whose ray is not below a coordinate, and the last that is not above one.
#[inline(always)]
fn column_from(low: i32) -> i32 {
    (low + (HALF - 1)).div_euclid(ONE)
}

#[inline(always)]
fn column_to(high: i32) -> i32 {
    (high - HALF).div_euclid(ONE)
}

#[inline(always)]
fn along(p: [i32; 3], q: [i32; 3], axis: usize) -> i64 {
    i64::from(q[axis] - p[axis])
}

/// Whether an edge keeps the rays that meet it.
#[inline(always)]
fn keeps(dx: i64, dy: i64) -> bool {
    (dy < 0) | ((dy == 0) & (dx > 0))
}
