"""Vessels of a single wall are hollow where drawings look into them, and nothing else is."""

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_fill_holes

import sketchcore as sk
from sketchcore.camera import VIEWPOINTS
from sketchcore.datagen.cleaning import place
from sketchcore.datagen.hollow import LEAST, hollow_out
from sketchcore.datagen.prepared import MeshObject


def revolved(profile):
    """An open surface of revolution about y, from (radius, height) to (radius, height)."""
    points = np.array(profile, float)
    return trimesh.creation.revolve(
        points, sections=48, transform=trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    )


JAR = revolved([(0, -0.4), (0.35, -0.4), (0.38, 0.0), (0.3, 0.4)])
DOME = revolved([(0.4, -0.4), (0.38, 0.0), (0.3, 0.3), (0, 0.4)])


def placed(mesh):
    return place(np.array(mesh.vertices), np.array(mesh.faces), "y", "x")


def depth_of(world):
    """How many voxels there are above the bottom, on the axis."""
    return int(world[32, :, 32].sum())


def test_a_jar_is_hollow():
    made = placed(JAR)
    assert not made.found["closed"]
    assert depth_of(sk.voxelize(trimesh.Trimesh(made.vertices, made.faces))) > 50
    assert depth_of(made.world) <= 2
    assert made.found["hollow_voxels"] > 10_000
    # Its wall is whole: from outside, no way leads in but by the mouth.
    lidded = made.world.copy()
    lidded[:, np.flatnonzero(made.world.any(axis=(0, 2)))[-1]] = 1
    assert binary_fill_holes(lidded).sum() - lidded.sum() > 0.9 * made.found["hollow_voxels"]


def test_a_jar_upside_down_is_full():
    made = placed(DOME)
    assert not made.found["closed"]
    assert made.found["hollow_voxels"] == 0
    assert depth_of(made.world) > 50


def test_a_crack_makes_nothing_hollow():
    solid = trimesh.creation.box((1, 1, 1)).subdivide().subdivide().subdivide()
    top = np.flatnonzero(solid.triangles_center[:, 1] > 0.499)
    cracked = trimesh.Trimesh(solid.vertices, np.delete(solid.faces, top[:2], axis=0))
    assert not cracked.is_watertight
    assert placed(cracked).found["hollow_voxels"] == 0


@pytest.mark.parametrize(
    "mesh", [trimesh.creation.icosphere(3), trimesh.creation.annulus(0.2, 0.5, 1.0), trimesh.creation.torus(0.4, 0.1)]
)
def test_closed_solids_stay_as_they_are(mesh):
    made = placed(mesh)
    assert made.found["hollow_voxels"] == 0
    np.testing.assert_array_equal(hollow_out(made.vertices, made.faces, made.world), made.world)


def test_what_is_small_stays():
    cup = JAR.copy()
    cup.apply_scale(0.15)
    made = placed(trimesh.util.concatenate([cup, trimesh.creation.box(bounds=[[0.1, -0.5, -0.5], [0.3, 0.5, 0.5]])]))
    assert made.found["hollow_voxels"] < LEAST


def test_camera_grids_are_as_hollow_as_the_world():
    made = placed(JAR)
    camera = VIEWPOINTS["quarter-037"]
    cells = MeshObject(made.vertices, made.faces, made.world).frusta(camera.packed[None])[0]
    expected = sk.to_camera_grid(made.world.astype(np.float32), camera)
    np.testing.assert_allclose(cells / 255, expected, atol=0.003)
    full = sk.frustum(trimesh.Trimesh(made.vertices, made.faces), camera)
    assert cells.sum() < 0.3 * full.sum()
