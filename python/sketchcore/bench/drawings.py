"""Shape to line drawing by rasterising or ray casting its mesh, and by OpenCV's filters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera

SIZE = 256
_SECTORS = 48
_DEPTH_STEP = 0.006
_CREASE = 2.0 - 2.0 * math.cos(math.radians(30.0))
_CLIP = (0.5, 4.0)

Floats = NDArray[np.float32]
Triangles = tuple[Floats, NDArray[np.int32]]


def _unit_cuboid() -> Triangles:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)


def _unit_cylinder(axis: int) -> Triangles:
    angle = (np.arange(_SECTORS) + 0.5) / _SECTORS * 2 * np.pi
    # The polygon has the circle's area.
    radius = math.sqrt(2 * math.pi / _SECTORS / math.sin(2 * math.pi / _SECTORS))
    rings = np.empty((2, _SECTORS, 3), np.float32)
    rings[..., (axis + 1) % 3], rings[..., (axis + 2) % 3] = radius * np.cos(angle), radius * np.sin(angle)
    rings[..., axis] = [[-1], [1]]
    i = np.arange(_SECTORS)
    j, n = (i + 1) % _SECTORS, _SECTORS
    sides = [[i, j, j + n], [i, j + n, i + n]]
    caps = [[0 * i[2:], i[1:-1] + 1, i[1:-1]], [0 * i[2:] + n, i[1:-1] + n, i[1:-1] + 1 + n]]
    faces = np.concatenate([np.stack(f, axis=1) for f in (*sides, *caps)])
    return rings.reshape(-1, 3), faces.astype(np.int32)


_UNITS = [_unit_cuboid(), *(_unit_cylinder(axis) for axis in range(3))]


def triangles(rows: NDArray[np.float64]) -> Triangles:
    """The mesh of a shape that only adds, packed as `Shape.packed`: parts may overlap, since the nearest is seen."""
    vertices, faces, count = [], [], 0
    for row in rows:
        unit, corners = _UNITS[int(row[0])]
        vertices.append(unit * row[5:].astype(np.float32) + row[2:5].astype(np.float32))
        faces.append(corners + count)
        count += len(unit)
    return np.concatenate(vertices), np.concatenate(faces)


def _normals(vertices: Floats, faces: NDArray[np.int32]) -> Floats:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal: Floats = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return normal


def opencv_edges() -> Callable[[Floats, Floats], NDArray[np.uint8]]:
    """Lines of inverse depth [256, 256] (0 where nothing is seen) and normals [256, 256, 3], by whole-image filters."""
    import cv2

    cv2.setNumThreads(1)
    along = np.array([[-1.0, 2.0, -1.0]], np.float32)
    ones = np.ones((1, 3), np.float32)

    def edges(near: Floats, normal: Floats) -> NDArray[np.uint8]:
        border = cv2.BORDER_CONSTANT
        steps = cv2.max(
            cv2.filter2D(near, -1, along, borderType=border), cv2.filter2D(near, -1, along.T, borderType=border)
        )
        ink: Any = cv2.compare(steps, _DEPTH_STEP, cv2.CMP_GT)
        seen = cv2.compare(near, 0.0, cv2.CMP_GT)
        for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            difference = cv2.subtract(normal[there], normal[here])
            turn = cv2.transform(cv2.multiply(difference, difference), ones)
            crease = cv2.bitwise_and(cv2.compare(turn, _CREASE, cv2.CMP_GT), cv2.bitwise_and(seen[here], seen[there]))
            cv2.bitwise_or(ink[here], crease, dst=ink[here])
        return ink  # type: ignore[no-any-return]

    return edges


def embree_drawing(camera: Camera) -> Callable[[NDArray[np.float64]], NDArray[np.uint8]]:
    """Ray casting by Embree; the mesh and its tree are built for every shape, the rays once."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    edges = opencv_edges()
    at = ((2 * np.arange(SIZE) + 1) / SIZE - 1) * math.tan(math.radians(camera.fov_degrees / 2))
    # Of length 1 along the camera's axis, so that distances are depths.
    rays = np.stack([*np.meshgrid(at, at), np.ones((SIZE, SIZE))], axis=-1) @ camera.rotation
    rays = rays.reshape(-1, 3).astype(np.float32)
    eyes = np.broadcast_to(camera.position.astype(np.float32), rays.shape).copy()

    def draw(rows: NDArray[np.float64]) -> NDArray[np.uint8]:
        vertices, faces = triangles(rows)
        scene = rtcore_scene.EmbreeScene()
        TriangleMesh(scene, vertices, faces)
        found = scene.run(eyes, rays, output=True)
        hit = found["primID"]
        near = np.where(hit >= 0, 1 / found["tfar"], 0).astype(np.float32)
        # What misses has index -1 and some normal; nothing is drawn there.
        normal = _normals(vertices, faces)[hit]
        return edges(near.reshape(SIZE, SIZE), normal.reshape(SIZE, SIZE, 3))

    return draw


_VERTEX = """
#version 330
uniform mat4 view;
in vec3 place;
in vec3 normal;
out vec4 seen;
void main() { gl_Position = view * vec4(place, 1.0); seen = vec4(normal, gl_Position.w); }
"""
_FRAGMENT = """
#version 330
in vec4 seen;
out vec4 color;
void main() { color = vec4(seen.xyz, 1.0 / seen.w); }
"""


def opengl_drawing(camera: Camera) -> Callable[[NDArray[np.float64]], Callable[[], NDArray[np.uint8]]]:
    """Rasterising by OpenGL through EGL; a shape's mesh is built and uploaded before the drawing that is timed.

    Depth and normals are 32-bit floats, as ours are.

    Raises:
        RuntimeError: if there is no EGL, or no driver behind it.
    """
    import cv2
    import moderngl

    edges = opencv_edges()
    try:
        context = moderngl.create_context(standalone=True, backend="egl")
    except Exception as error:  # glcontext raises bare Exceptions
        raise RuntimeError(
            f"no OpenGL through EGL here ({error}); on Debian: apt-get install libegl1 libgl1-mesa-dri"
        ) from None
    context.enable(moderngl.DEPTH_TEST)
    program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
    color = context.texture((SIZE, SIZE), 4, dtype="f4")
    frame = context.framebuffer([color], context.depth_renderbuffer((SIZE, SIZE)))
    near, far = _CLIP
    focal = 1 / math.tan(math.radians(camera.fov_degrees / 2))
    # Row 0 of the image, where y is least, comes first in memory too.
    project = np.diag([focal, focal, (far + near) / (far - near), 0.0])
    project[2, 3], project[3, 2] = -2 * far * near / (far - near), 1.0
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = camera.rotation, -camera.rotation @ camera.position
    program["view"].write((project @ place).T.astype(np.float32).tobytes())
    read = np.empty((SIZE, SIZE, 4), np.float32)

    def prepare(rows: NDArray[np.float64]) -> Callable[[], NDArray[np.uint8]]:
        vertices, faces = triangles(rows)
        corners = np.concatenate([vertices[faces], np.repeat(_normals(vertices, faces)[:, None], 3, axis=1)], axis=2)
        uploaded = context.buffer(np.ascontiguousarray(corners, np.float32).tobytes())
        array = context.vertex_array(program, [(uploaded, "3f 3f", "place", "normal")])

        def draw() -> NDArray[np.uint8]:
            frame.use()
            frame.clear(0.0, 0.0, 0.0, 0.0)
            array.render()
            frame.read_into(read, components=4, dtype="f4")
            return edges(cv2.extractChannel(read, 3), cv2.cvtColor(read, cv2.COLOR_RGBA2RGB))

        return draw

    return prepare
