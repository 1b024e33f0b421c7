"""The solid inside a mesh, against an independent ray caster, and by what is known of it."""

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import reference
import reference_solid
from sketchcore import _core
from sketchcore.grids import SIDE, voxelize
from sketchcore.mesh import extract_mesh

FAR = 0.5 / reference_solid.COVER
BALL = trimesh.creation.icosphere(2, 0.3)


def in_place(mesh):
    """The mesh with a speck at either end of a diagonal, smaller than any voxel: it stays as large as it is."""
    specks = [trimesh.creation.box(bounds=sorted([[at] * 3, [at * (1 - 1e-5)] * 3])) for at in (FAR, -FAR)]
    return trimesh.util.concatenate([mesh, *specks])


def nearness(mesh, voxels):
    """Distances of voxels' centres from the surface, world units."""
    corners = reference_solid.placed(mesh.vertices, mesh.faces)
    at = reference.voxel_centers()[tuple(voxels.T)]
    to = [trimesh.triangles.closest_point(corners, np.broadcast_to(p, (len(corners), 3))) for p in at]
    return np.array([np.linalg.norm(near - p, axis=1).min() for near, p in zip(to, at, strict=True)])


def same_but_at_the_surface(mesh, expected):
    differ = np.argwhere(voxelize(mesh) != expected)
    assert (nearness(mesh, differ) < 1e-6).all()


def _primitive(kind, sections):
    make = trimesh.creation
    return {
        "box": lambda: make.box(),
        "ball": lambda: make.icosphere(sections % 3),
        "cylinder": lambda: make.cylinder(0.5, 1.3, sections=sections),
        "cone": lambda: make.cone(0.6, 1.0, sections=sections),
        "capsule": lambda: make.capsule(count=[sections + 1, sections + 2]),
        "torus": lambda: make.torus(0.5, 0.2, major_sections=sections, minor_sections=sections + 1),
        "pipe": lambda: make.annulus(0.3, 0.5, 1.1, sections=sections),
    }[kind]()


@st.composite
def parts(draw):
    """Watertight meshes of any proportions, turned anyhow; half of them with vertices on voxel centres."""
    kinds = ["box", "ball", "cylinder", "cone", "capsule", "torus", "pipe"]
    mesh = _primitive(draw(st.sampled_from(kinds)), draw(st.integers(3, 12)))
    turn = draw(st.sampled_from(["straight", "anyhow"]))
    if turn == "anyhow":
        mesh.apply_transform(
            trimesh.transformations.random_rotation_matrix(np.array(draw(st.tuples(*[st.floats(0, 1)] * 3))))
        )
    mesh.apply_scale(draw(st.tuples(*[st.floats(0.1, 0.4)] * 3)))
    mesh.apply_translation(draw(st.tuples(*[st.floats(-0.1, 0.1)] * 3)))
    if draw(st.booleans()):
        mesh.vertices = (np.floor(mesh.vertices * SIDE) + 0.5) / SIDE
    if draw(st.booleans()):
        mesh.invert()
    return mesh


@pytest.mark.slow
@settings(max_examples=60)
@given(st.lists(parts(), min_size=1, max_size=3))
def test_closed_meshes_are_what_a_ray_caster_finds(meshes):
    mesh = in_place(trimesh.util.concatenate(meshes))
    expected = reference_solid.closed_solid(mesh.vertices, mesh.faces)
    # Twice the same, the other way round: nothing is wound around, and each face is taken once (`rust/src/solid.rs`).
    assume(expected.any())
    same_but_at_the_surface(mesh, expected)


@pytest.mark.slow
@settings(max_examples=30)
@given(parts(), st.data())
def test_open_meshes_are_decided_by_vote(mesh, data):
    mesh = in_place(mesh)
    kept = data.draw(st.lists(st.booleans(), min_size=len(mesh.faces) - 24, max_size=len(mesh.faces) - 24))
    kept = np.array([*kept, *[True] * 24])
    for faces in (mesh.faces[kept], np.where(kept[:, None], mesh.faces, mesh.faces[:, ::-1])):
        changed = trimesh.Trimesh(mesh.vertices, faces, process=False)
        expected = reference_solid.voted_solid(changed.vertices, faces)
        same_but_at_the_surface(changed, expected)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.1, 0.5, 0.9]))
def test_the_surface_of_voxels_holds_those_voxels(seed, share):
    # Marching cubes puts every vertex on a line between two voxel centres: all rays meet edges and vertices.
    volume = np.zeros((SIDE,) * 3, np.uint8)
    volume[20:36, 24:40, 28:44] = np.random.default_rng(seed).random((16, 16, 16)) < share
    np.testing.assert_array_equal(voxelize(in_place(extract_mesh(volume, smooth=False))), volume)


def test_a_mesh_is_scaled_and_centred():
    volume = voxelize(trimesh.creation.box((30.0, 15.0, 7.5), trimesh.transformations.translation_matrix((7, -9, 2e3))))
    assert volume.dtype == np.uint8
    # 53.3, 26.7 and 13.3 voxels around the middle.
    ends = [
        (np.flatnonzero(volume.any(axis=a)).min(), np.flatnonzero(volume.any(axis=a)).max())
        for a in ((1, 2), (0, 2), (0, 1))
    ]
    assert ends == [(5, 58), (19, 44), (25, 38)]
    assert volume.sum() == 54 * 26 * 14


def test_a_ball_has_its_volume():
    volume = voxelize(trimesh.creation.icosphere(5))
    assert volume.sum() == pytest.approx(4 / 3 * np.pi * (SIDE / 2.4) ** 3, rel=2e-3)


def test_overlapping_parts_are_one_solid_and_cavities_stay_hollow():
    box, inner = trimesh.creation.box(bounds=[[-0.25] * 3, [0.25] * 3]), trimesh.creation.icosphere(2, 0.2)
    whole = voxelize(in_place(box))
    joined = trimesh.util.concatenate([box, inner])
    np.testing.assert_array_equal(voxelize(in_place(joined)), whole)
    inner.invert()
    hollow = voxelize(in_place(trimesh.util.concatenate([box, inner])))
    np.testing.assert_array_equal(hollow, whole - voxelize(in_place(inner)))


def test_vertices_may_be_split_and_faces_doubled():
    whole = voxelize(BALL)
    split = trimesh.Trimesh(BALL.triangles.reshape(-1, 3), np.arange(3 * len(BALL.faces)).reshape(-1, 3), process=False)
    assert not split.is_watertight
    np.testing.assert_array_equal(voxelize(split), whole)
    both_sides = np.concatenate([BALL.faces, BALL.faces[:, ::-1]])
    np.testing.assert_array_equal(voxelize(trimesh.Trimesh(BALL.vertices, both_sides, process=False)), whole)
    flat = np.repeat(np.arange(10)[:, None], 3, axis=1)
    more = np.concatenate([BALL.faces, flat, BALL.faces[:1]])
    np.testing.assert_array_equal(voxelize(trimesh.Trimesh(BALL.vertices, more, process=False)), whole)


def test_what_encloses_nothing_is_empty():
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
    assert voxelize(sheet).sum() == 0


def test_a_mesh_is_left_as_it_is():
    mesh = BALL.copy()
    mesh.vertices.setflags(write=False)
    voxelize(mesh)
    np.testing.assert_array_equal(mesh.vertices, BALL.vertices)


def broken(vertices=BALL.vertices, faces=BALL.faces):
    return trimesh.Trimesh(np.array(vertices), np.array(faces), process=False, validate=False)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (trimesh.Trimesh(), "the mesh has no faces"),
        (broken(faces=BALL.faces[:0]), "the mesh has no faces"),
        (broken(faces=[[0, 1, 162]]), "face 0 names vertex 162; with 162 vertices every index must lie between 0 and"),
        (broken(faces=[[0, 1, 2], [0, -1, 2]]), "face 1 names vertex -1"),
        (broken(BALL.vertices * [1, np.nan, 1]), "vertex 0 has a NaN or infinite coordinate"),
        (
            broken(np.where(BALL.vertices == BALL.vertices[7], np.inf, BALL.vertices)),
            "has a NaN or infinite coordinate",
        ),
        (broken(BALL.vertices * 0), "largest side is 0; it must be more than 0"),
        (broken(np.sign(BALL.vertices) * 1.5e308), "largest side is inf"),
    ],
)
def test_what_is_no_mesh_is_named(mesh, message):
    with pytest.raises(ValueError, match=message):
        voxelize(mesh)


def test_the_core_names_wrong_arrays():
    vertices, faces = np.array(BALL.vertices), np.array(BALL.faces)
    with pytest.raises(ValueError, match=r"vertices must have shape \[n, 3\], got \[162, 2\]"):
        _core.voxelize_mesh(vertices[:, :2].copy(), faces)
    with pytest.raises(ValueError, match=r"faces must have shape \[n, 3\], got \[240, 4\]"):
        _core.voxelize_mesh(vertices, faces.reshape(240, 4))
    with pytest.raises(ValueError, match="faces must be C-contiguous"):
        _core.voxelize_mesh(vertices, np.asfortranarray(faces))
    with pytest.raises(TypeError):
        _core.voxelize_mesh(vertices, faces.astype(np.float64))


@pytest.mark.parametrize(
    "value", [None, b"mesh.obj", trimesh.Scene(BALL), BALL.vertices], ids=["none", "bytes", "scene", "array"]
)
def test_only_meshes_and_shapes_are_voxelized(value):
    with pytest.raises(TypeError, match=rf"a path to a mesh file or a sketchcore.Shape, got {type(value).__name__}"):
        voxelize(value)
