use super::*;
use crate::csg::{Kind, Primitive, Shape};
use glam::DVec3;
use proptest::prelude::*;

type Mesh = (Vec<[f64; 3]>, Vec<[i64; 3]>);

/// A box between two corners.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { low[a] } else { high[a] });
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    ((0..8).map(corner).collect(), sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn joined(meshes: &[Mesh]) -> Mesh {
    let (mut vertices, mut faces) = Mesh::default();
    for (more, corners) in meshes {
        let first = vertices.len() as i64;
        faces.extend(corners.iter().map(|face| face.map(|i| i + first)));
        vertices.extend(more);
    }
    (vertices, faces)
}

/// A frame that keeps a mesh where it is: a box of almost no size at each of two far corners of the largest cube that fits.
fn in_place(mesh: Mesh) -> Mesh {
    let far = 0.5 / COVER;
    let speck = |at: f64| cuboid([at; 3], [at * (1.0 - 1e-5); 3]);
    joined(&[mesh, speck(far), speck(-far)])
}

fn solid((vertices, faces): &Mesh) -> BitGrid {
    voxelize(vertices, faces).unwrap()
}

fn count(mesh: Mesh) -> u32 {
    solid(&in_place(mesh)).count()
}

fn votes((vertices, faces): &Mesh) -> BitGrid {
    BitGrid::of_words(vote(&Frame::around(vertices, faces).unwrap(), vertices, faces))
}

/// Multiples of an eighth of a voxel, every fourth of them on voxel centres.
fn coordinate() -> impl Strategy<Value = f64> {
    (-25 * 8..=25 * 8).prop_map(|i| f64::from(i) / 512.0)
}

fn any_cuboid() -> impl Strategy<Value = Mesh> {
    let pair = || (coordinate(), coordinate()).prop_map(|(a, b)| if a < b { [a, b] } else { [b, a] });
    [pair(), pair(), pair()].prop_map(|[x, y, z]| cuboid([x[0], y[0], z[0]], [x[1], y[1], z[1]]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn boxes_of_triangles_are_boxes(mesh in any_cuboid()) {
        let (low, high) = (mesh.0[0], mesh.0[7]);
        let inside = |i: usize, a: usize| {
            let center = crate::voxel::voxel_center(i);
            low[a] <= center && center < high[a]
        };
        let words = (0..COLUMNS).map(|c| {
            let column = inside(c / SIDE, 0) && inside(c % SIDE, 1);
            (0..SIDE).fold(0, |word, z| word | u64::from(column && inside(z, 2)) << z)
        });
        prop_assert_eq!(solid(&in_place(mesh)), BitGrid::of_words(words.collect()));
    }

    #[test]
    fn a_fan_around_a_voxel_centre_leaves_no_stray_column(
        ring in prop::collection::vec((coordinate(), coordinate()), 3..9), top in coordinate()
    ) {
        // Two fans over the same ring, one folded onto the plane z = 1/128: whatever the ring does to itself, they close.
        let height = 1.0 / 128.0;
        let mut vertices: Vec<_> = ring.iter().map(|&(x, y)| [x, y, height]).collect();
        vertices.extend([[height, height, top], [height, height, height]]);
        let n = ring.len() as i64;
        let faces = (0..n).flat_map(|i| [[i, (i + 1) % n, n], [(i + 1) % n, i, n + 1]]);
        let (vertices, faces) = in_place((vertices, faces.collect()));
        let crossings = Crossings::of(&Frame::around(&vertices, &faces).unwrap().place(&vertices, AXES[2]), &faces);
        prop_assert!(crossings.closed());
        prop_assert!(crossings.winding().iter().all(|word| word >> 60 == 0));
    }

    #[test]
    fn every_instruction_set_counts_the_same(
        vertices in prop::collection::vec([coordinate(), coordinate(), coordinate()], 3..40), more in 1..8_i64
    ) {
        // A soup of faces, large and small, on a lattice that meets rays and voxels' centres.
        let n = vertices.len() as i64;
        let faces: Vec<_> = (0..3 * n).map(|i| [i % n, (i * more + 1) % n, (i / 2 + more) % n]).collect();
        let points = Frame { middle: [0.0; 3], scale: SIDE as f64 * f64::from(ONE) }.place(&vertices, AXES[2]);
        let mut plain = Crossings::default();
        plain.add(&points, &faces);
        let chosen = Crossings::of(&points, &faces);
        prop_assert_eq!(chosen.winding(), plain.winding());
        prop_assert_eq!(chosen.closed(), plain.closed());
        for column in 0..COLUMNS {
            prop_assert_eq!(chosen.winding_both_ways(column, 31), plain.winding_both_ways(column, 31));
        }
    }

    #[test]
    fn faces_may_be_turned_over_and_come_twice(
        mesh in any_cuboid(), turned in prop::collection::vec(any::<bool>(), 12), twice in 0..12_usize
    ) {
        prop_assume!((0..3).all(|a| mesh.0[7][a] - mesh.0[0][a] > 0.1));
        let whole = count(mesh.clone());
        let (vertices, mut faces) = mesh;
        for (face, &turn) in faces.iter_mut().zip(&turned) {
            if turn {
                face.swap(1, 2);
            }
        }
        prop_assert_eq!(count((vertices.clone(), faces.clone())), whole);
        faces.push(faces[twice]);
        faces.push([3, 3, 5]);
        prop_assert_eq!(count((vertices.clone(), faces.clone())), whole);
        faces.extend(faces.clone().iter().map(|&[a, b, c]| [a, c, b]));
        prop_assert_eq!(count((vertices, faces)), whole);
    }
}

#[test]
fn the_cube_is_120_percent_of_the_largest_side() {
    for shift in [0.0, 1e3] {
        let grid = solid(&cuboid([shift, 0.0, 0.0], [shift + 3.0, 1.5, 0.75]));
        assert_eq!(grid.bounds(), Some([(5, 58), (19, 44), (25, 38)]));
        assert_eq!(grid.count(), 54 * 26 * 14);
    }
}

#[test]
fn parts_that_overlap_are_one_solid_and_cavities_stay_hollow() {
    let (outer, inner) = (cuboid([-0.25; 3], [0.25; 3]), cuboid([-0.125; 3], [0.125; 3]));
    let turned = |(v, f): &Mesh| (v.clone(), f.iter().map(|&[a, b, c]| [a, c, b]).collect::<Vec<_>>());
    let whole = 32_u32.pow(3);
    assert_eq!(count(outer.clone()), whole);
    assert_eq!(count(turned(&outer)), whole);
    assert_eq!(count(joined(&[outer.clone(), inner.clone()])), whole);
    assert_eq!(count(joined(&[outer.clone(), turned(&inner)])), whole - 16_u32.pow(3));
    // More of them than any fixed number of digits would hold.
    assert_eq!(count(joined(&vec![outer.clone(); 300])), whole);
    let beside = cuboid([0.25, -0.25, -0.25], [0.375, 0.25, 0.25]);
    assert_eq!(count(joined(&[outer, beside])), whole + 32 * 32 * 8);
}

#[test]
fn missing_sides_are_outvoted() {
    let mesh = cuboid([-0.25; 3], [0.25; 3]);
    for side in 0..6 {
        let mut open = mesh.clone();
        open.1.drain(2 * side..2 * side + 2);
        assert_eq!(count(open.clone()), 32_u32.pow(3), "side {side}");
        // A pipe: two sides of three.
        if side % 2 == 1 {
            open.1.drain(2 * side - 2..2 * side);
            assert_eq!(count(open), 32_u32.pow(3), "pipe {side}");
        }
    }
}

#[test]
fn rays_along_all_axes_say_the_same_of_a_closed_mesh() {
    let cylinder = |axis, half: [f64; 3]| Primitive {
        kind: Kind::Cylinder { axis },
        additive: true,
        center: DVec3::ZERO,
        half: half.into(),
    };
    let rim = 96;
    for axis in 0..3 {
        let place = |u: f64, v: f64, w: f64| {
            let mut at = [0.0; 3];
            [at[(axis + 1) % 3], at[(axis + 2) % 3], at[axis]] = [u, v, w];
            at
        };
        let angle = |i: usize| (i as f64 + 0.4) / rim as f64 * std::f64::consts::TAU;
        let end = |w: f64| (0..rim).map(move |i| place(0.3 * angle(i).cos(), 0.3 * angle(i).sin(), w));
        let mut vertices: Vec<_> = end(-0.4).chain(end(0.4)).collect();
        vertices.extend([place(0.0, 0.0, -0.4), place(0.0, 0.0, 0.4)]);
        let n = rim as i64;
        let sector = |i: i64| {
            let (j, up) = ((i + 1) % n, n);
            [[j, i, 2 * n], [i + up, j + up, 2 * n + 1], [i, j, j + up], [i, j + up, i + up]]
        };
        let mesh = in_place((vertices, (0..n).flat_map(sector).collect()));
        assert_eq!(solid(&mesh), votes(&mesh));
        let mut half = [0.3; 3];
        half[axis] = 0.4;
        let exact = BitGrid::of_shape(&Shape::new(vec![cylinder(axis, half)]).unwrap());
        assert!(solid(&mesh).count().abs_diff(exact.count()) < exact.count() / 100);
    }
}

#[test]
fn what_is_no_mesh_is_refused() {
    let (vertices, faces) = cuboid([0.0; 3], [1.0; 3]);
    let refused = |v: &[[f64; 3]], f: &[[i64; 3]]| voxelize(v, f).unwrap_err();
    assert_eq!(refused(&vertices, &[]), SolidError::NoFaces);
    for index in [8, -1] {
        let wrong = [[0, 1, 2], [3, 4, index]];
        assert_eq!(refused(&vertices, &wrong), SolidError::Index { face: 1, index, count: 8 });
    }
    assert_eq!(refused(&[[2.0; 3]; 8], &faces), SolidError::Extent(0.0));
    assert_eq!(
        refused(&[[1e308; 3], [-1e308; 3], [0.0; 3]], &[[0, 1, 2]]),
        SolidError::Extent(f64::INFINITY)
    );
    for bad in [f64::NAN, f64::INFINITY] {
        let mut wrong = vertices.clone();
        wrong[3][1] = bad;
        assert_eq!(refused(&wrong, &faces), SolidError::Vertex(3));
        // What no face names does not count.
        wrong[3] = vertices[3];
        wrong.push([bad; 3]);
        assert_eq!(solid(&(wrong, faces.clone())), solid(&(vertices.clone(), faces.clone())));
    }
}

#[test]
fn transposing_moves_every_bit() {
    let rows: [u64; SIDE] =
        std::array::from_fn(|i| 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(i as u64 * i as u64 + 1));
    let turned = transposed(rows);
    for (i, row) in rows.iter().enumerate() {
        assert!((0..SIDE).all(|j| row >> j & 1 == turned[j] >> i & 1));
    }
}
