import os

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sketchcore import _core
from sketchcore.mesh import MESH_SUFFIXES, extract_mesh, save_mesh

N = 64
CENTERS = np.stack(np.meshgrid(*[(np.arange(N) + 0.5) / N - 0.5] * 3, indexing="ij"), axis=-1)


def assert_solid(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert np.isfinite(mesh.vertices).all()
    assert np.abs(mesh.vertices).max() < 0.5 + 1 / 32
    assert mesh.area_faces.min() > 0


def box_distance(points, half):
    outside = np.abs(points) - half
    return np.linalg.norm(np.maximum(outside, 0), axis=-1) + np.minimum(outside.max(axis=-1), 0)


def tilted(points, degrees, axis):
    return points @ trimesh.transformations.rotation_matrix(np.radians(degrees), axis)[:3, :3]


def cylinder_distance(points, radius, half):
    return np.maximum(np.hypot(points[..., 0], points[..., 2]) - radius, np.abs(points[..., 1]) - half)


def binary(distance):
    return (distance < 0).astype(np.uint8)


def fractional(distance):
    return np.clip(0.5 - N * distance, 0, 1).astype(np.float32)


def embedded(blob, corner):
    volume = np.zeros((N, N, N), np.float32)
    x, y, z = (int(c * (N - size)) for c, size in zip(corner, blob.shape, strict=True))
    volume[x : x + blob.shape[0], y : y + blob.shape[1], z : z + blob.shape[2]] = blob
    return volume


# Values at 1/2, just beside it, and equal far from it are where marching cubes falls apart.
TRICKY = st.sampled_from([0.0, 0.25, 0.5, float(np.nextafter(np.float32(0.5), np.float32(1))), 0.501, 0.75, 1.0])
ANY = st.floats(0, 1, width=32)
BLOBS = hnp.arrays(
    np.float32, hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=6), elements=TRICKY | ANY
).filter(lambda blob: blob.max() > 0.5)
CORNERS = st.tuples(*[st.sampled_from([0.0, 0.4, 1.0])] * 3)


@given(BLOBS, CORNERS, st.booleans())
@settings(deadline=None, max_examples=60)
def test_any_blob_anywhere_gives_a_solid(blob, corner, smooth):
    assert_solid(extract_mesh(embedded(blob, corner), smooth=smooth))


@pytest.mark.parametrize(
    "noise",
    [
        lambda random, shape: random.random(shape) < 0.05,
        lambda random, shape: random.random(shape) < 0.5,
        lambda random, shape: random.random(shape, dtype=np.float32),
        lambda random, shape: random.integers(0, 5, shape) / 4,
        lambda random, shape: np.indices(shape).sum(axis=0) % 2,
        lambda random, shape: np.indices(shape).sum(axis=0) // 2 % 2,
        lambda random, shape: np.ones(shape, np.uint8),
    ],
    ids=["sparse", "dense", "float", "quarters", "checkerboard", "layers", "full"],
)
def test_noise_gives_a_solid(noise):
    assert_solid(extract_mesh(noise(np.random.default_rng(0), (32, 32, 32))))


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.01, 0.99))
@settings(deadline=None, max_examples=4, suppress_health_check=[HealthCheck.too_slow])
def test_random_volumes_give_a_solid(seed, share):
    volume = np.random.default_rng(seed).random((N, N, N))
    assert_solid(extract_mesh(volume < share, smooth=False))


@given(BLOBS, CORNERS)
@settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_blob_is_still_solid_after_a_file(tmp_path, blob, corner):
    # STL keeps three separate float32 corners a face, so a reader must merge equal ones: the hardest format.
    path = tmp_path / "blob.stl"
    save_mesh(extract_mesh(embedded(blob, corner)), path)
    assert trimesh.load_mesh(path).is_watertight


def test_a_full_volume_is_the_cube_of_the_world():
    mesh = extract_mesh(np.ones((N, N, N)), smooth=False)
    np.testing.assert_allclose(mesh.bounds, [[-0.5] * 3, [0.5] * 3])


def test_a_voxel_is_where_it_belongs():
    volume = np.zeros((N, N, N), np.float32)
    volume[3, 20, 60] = 1
    mesh = extract_mesh(volume)
    expected = (np.array([3, 20, 60]) + 0.5) / N - 0.5
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), expected, atol=1e-6)
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), 1 / N, atol=0.5 / N)


def test_a_cavity_counts_as_outside():
    distance = box_distance(CENTERS, [0.3, 0.3, 0.3])
    mesh = extract_mesh(binary(np.abs(distance + 0.1) - 0.1))
    assert mesh.body_count == 2
    assert mesh.volume == pytest.approx(0.6**3 - 0.2**3, rel=0.05)


def test_another_level_gives_another_surface():
    ball = np.clip(1 - 2 * np.linalg.norm(CENTERS, axis=-1), 0, 1)
    for level in (0.25, 0.5, 0.75):
        radius = (1 - level) / 2
        assert extract_mesh(ball, level).volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02)


def test_a_ball_keeps_its_volume():
    ball = binary(np.linalg.norm(CENTERS, axis=-1) - 20 / N)
    stairs, smooth = extract_mesh(ball, smooth=False), extract_mesh(ball)
    assert smooth.volume == pytest.approx(stairs.volume, rel=0.02)
    assert smooth.volume == pytest.approx(4 / 3 * np.pi * (20 / N) ** 3, rel=0.02)
    radii = [np.linalg.norm(mesh.vertices, axis=1).std() * N for mesh in (stairs, smooth)]
    assert radii[1] < 0.05
    assert radii[1] < 0.25 * radii[0]


@pytest.mark.parametrize("render", [binary, fractional])
@pytest.mark.parametrize(
    "distance",
    [
        box_distance(tilted(CENTERS, 25, [0.3, 0.2, 1]), [0.24, 0.16, 0.2]),
        cylinder_distance(CENTERS, 0.2, 0.22),
        cylinder_distance(tilted(CENTERS, 15, [1, 0, 0.3]), 0.17, 0.22),
    ],
    ids=["slanted box", "cylinder", "slanted cylinder"],
)
def test_stair_steps_go(distance, render):
    """Normals come within a few degrees of the true ones, and no vertex moves by a voxel."""
    gradient = np.stack(np.gradient(distance), axis=-1)

    def sampled(grid, points):
        index = np.clip(((points + 0.5) * N).astype(int), 0, N - 1)
        return grid[tuple(index.T)]

    def error(mesh):
        true = sampled(gradient, mesh.triangles_center)
        length = np.linalg.norm(true, axis=1)
        cosine = (mesh.face_normals * true).sum(axis=1) / length
        angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        # Across an edge the gradient of the distance is short: there is no true normal there.
        return np.average(angles, weights=mesh.area_faces * (length > 0.98 / N))

    volume = render(distance)
    stairs, smooth = extract_mesh(volume, smooth=False), extract_mesh(volume)
    assert error(smooth) < 0.95 * error(stairs)
    assert error(smooth) < 3.5
    assert np.linalg.norm(smooth.vertices - stairs.vertices, axis=1).max() * N < 1
    assert smooth.volume == pytest.approx(stairs.volume, rel=0.02)


@pytest.mark.parametrize("render", [binary, fractional])
def test_a_box_keeps_its_edges(render):
    half = np.array([15.0, 10.0, 12.0]) / N
    mesh = extract_mesh(render(box_distance(CENTERS, half)))
    assert np.abs(box_distance(mesh.vertices, half)).max() * N < 0.7
    for corner in half * (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1):
        assert np.linalg.norm(mesh.vertices - corner, axis=1).min() * N < 0.9
    flat = np.abs(mesh.face_normals).max(axis=1) > np.cos(np.radians(8))
    assert mesh.area_faces[flat].sum() > 0.85 * mesh.area


def test_the_result_repeats_itself():
    volume = np.random.default_rng(1).random((16, 16, 16))
    np.testing.assert_array_equal(extract_mesh(volume).vertices, extract_mesh(volume).vertices)


@pytest.mark.parametrize("volume", [np.zeros((N, N, N)), np.full((N, N, N), 0.5, np.float32)])
def test_an_empty_volume_is_named(volume):
    with pytest.raises(ValueError, match=r"the volume is empty: no voxel is above 0\.5"):
        extract_mesh(volume)


@pytest.mark.parametrize("level", [0.0, 1.0, -3.0, float("nan")])
def test_a_level_outside_is_named(level):
    with pytest.raises(ValueError, match="level must lie between 0 and 1"):
        extract_mesh(np.ones((4, 4, 4)), level)


def test_a_wrong_volume_is_named():
    with pytest.raises(ValueError, match="must be a cube"):
        extract_mesh(np.ones((4, 4)))


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_files_come_back(suffix, tmp_path):
    mesh = extract_mesh(fractional(np.linalg.norm(CENTERS, axis=-1) - 0.2))
    path = tmp_path / f"ball{suffix.upper()}"
    save_mesh(mesh, path)
    assert os.listdir(tmp_path) == [path.name]
    loaded = trimesh.load_mesh(path)
    assert loaded.is_watertight
    assert loaded.volume == pytest.approx(mesh.volume, rel=1e-4)
    np.testing.assert_allclose(loaded.bounds, mesh.bounds, atol=1e-6)


def test_an_unknown_suffix_is_named_and_nothing_written(tmp_path):
    mesh = trimesh.creation.box()
    with pytest.raises(ValueError, match=r"\.glb, \.obj, \.stl, \.ply; got 'box\.dae'"):
        save_mesh(mesh, tmp_path / "box.dae")
    assert list(tmp_path.iterdir()) == []


def test_the_core_names_wrong_meshes():
    vertices, faces = np.eye(3), np.array([[0, 1, 2]], dtype=np.uint32)
    with pytest.raises(ValueError, match="names vertex 3; with 3 vertices"):
        _core.bilateral(vertices, faces + np.uint32(1), 1, 1.0, 0.35)
    with pytest.raises(ValueError, match="sigma_normal must be finite and more than 0, got -1"):
        _core.bilateral(vertices, faces, 1, 1.0, -1.0)
    with pytest.raises(ValueError, match="vertex 0 has a NaN"):
        _core.bilateral(vertices * np.nan, faces, 1, 1.0, 0.35)
