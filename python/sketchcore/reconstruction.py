"""From drawings to a solid: the package's main verb, and what it returns."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera, as_camera, pack_cameras
from sketchcore.drawing import load_drawing
from sketchcore.mesh import MESH_SUFFIXES, extract_mesh, save_mesh
from sketchcore.nets.loading import build_model
from sketchcore.nets.model import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.weights import PRETRAINED, load_weights
from sketchcore.rounds import TOLERANCE, Volume, until_settled
from sketchcore.viewpoint import guess_camera
from sketchcore.volume import load_binvox, load_npz, save_binvox, save_npz

if TYPE_CHECKING:
    import torch
    import trimesh

View = str | Camera
ModelLike = str | os.PathLike[str] | Model | None
Progress = Callable[[int, int, Volume], None]


@dataclass(frozen=True)
class Reconstruction:
    """A solid, and the drawings that it was made from.

    Attributes:
        probability: float32 [64, 64, 64], world grid (x, y, z), probability of occupancy.
        views: the camera of each drawing; where it was looked for, the one that was found.
        trace: root-mean-square change of the probability in each round that was run.
        drawings: uint8 [n, 256, 256], the drawings as the network saw them, ink 255 on 0: those that were out of place,
            where they belong.
        guessed: the name of the viewpoint that is nearest to the camera, where none was given.
    """

    probability: Volume
    views: tuple[Camera, ...] = ()
    trace: tuple[float, ...] = ()
    drawings: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 256, 256), np.uint8))
    guessed: str | None = None
    _model: ModelLike = field(default=None, repr=False, compare=False)

    def update(
        self,
        drawing: Any,
        view: View,
        *,
        iterations: int = 5,
        tolerance: float = TOLERANCE,
        align: bool | None = None,
        model: ModelLike = None,
        progress: Progress | None = None,
    ) -> Reconstruction:
        """The reconstruction with one more drawing; this one stays as it is.

        All drawings are visited again. A volume that was loaded without its drawings counts as one prediction among
        those of the drawings.

        Args:
            drawing: as for `reconstruct`.
            view: the viewpoint's name, or the camera.
            iterations: rounds over all drawings, at most.
            tolerance: as for `reconstruct`.
            align: as for `reconstruct`.
            model: as for `reconstruct`; None for the one that this reconstruction was made with.
            progress: as for `reconstruct`.
        """
        drawings = np.concatenate([self.drawings, load_drawing(drawing)[None]])
        views = (*self.views, as_camera(view))
        start = None if self.views else self.probability
        made = _run(
            Sketches(drawings, pack_cameras(views)),
            views,
            iterations,
            tolerance,
            align if start is None else False,
            load_model(model if model is not None else self._model),
            progress,
            start,
        )
        return replace(made, guessed=self.guessed)

    def mesh(self, *, smooth: bool = True) -> trimesh.Trimesh:
        """The surface at probability 0.5 in world units: watertight, closed at the border of the grid.

        Raises:
            ValueError: if the volume is empty.
        """
        return extract_mesh(self.probability, smooth=smooth)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the mesh (.glb, .obj, .stl, .ply), the voxels (.binvox), or everything (.npz), by the suffix.

        Raises:
            ValueError: for another suffix; for a mesh of an empty volume.
            FileNotFoundError: if the folder does not exist.
        """
        suffix = Path(path).suffix.lower()
        if suffix in MESH_SUFFIXES:
            save_mesh(self.mesh(), path)
        elif suffix == ".binvox":
            save_binvox(path, self.probability)
        elif suffix == ".npz":
            cameras = pack_cameras(self.views)
            save_npz(path, self.probability, cameras=cameras, trace=np.array(self.trace), drawings=self.drawings)
        else:
            known = ", ".join((*MESH_SUFFIXES, ".npz", ".binvox"))
            raise ValueError(f"cannot save as {suffix or 'a file without a suffix'!r}; the suffixes are {known}")


def load(path: str | os.PathLike[str]) -> Reconstruction:
    """Reads what `Reconstruction.save` wrote as .npz (everything) or .binvox (the voxels, 0 or 1).

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: for another suffix, or a damaged file.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".binvox":
        return Reconstruction(_checked_side(load_binvox(path), path))
    if suffix != ".npz":
        raise ValueError(f"volumes come back from .npz and .binvox, not from {suffix or 'no suffix'!r}")
    arrays = load_npz(path)
    probability = _checked_side(arrays["probability"], path)
    if not {"cameras", "drawings", "trace"} <= arrays.keys():
        return Reconstruction(probability)
    rows, trace, drawings = arrays["cameras"], arrays["trace"], arrays["drawings"]
    if rows.dtype != np.float64 or rows.ndim != 2 or trace.dtype != np.float64 or trace.ndim != 1:
        raise ValueError(f"{path}: its cameras must be float64 [n, 15], and its trace float64 [rounds]")
    views = tuple(Camera.from_packed(row) for row in rows)
    if drawings.dtype != np.uint8 or drawings.shape != (len(views), 256, 256):
        raise ValueError(f"{path}: its drawings must be uint8 [{len(views)}, 256, 256], one a camera")
    return Reconstruction(probability, views, tuple(float(t) for t in trace), drawings)


def _checked_side(volume: Volume, path: str | os.PathLike[str]) -> Volume:
    if volume.shape != (64, 64, 64):
        raise ValueError(f"{path} holds a grid of shape {list(volume.shape)}; reconstructions are [64, 64, 64]")
    return volume


def reconstruct(
    drawings: Any,
    views: View | Sequence[View] | None = None,
    *,
    iterations: int = 5,
    tolerance: float = TOLERANCE,
    align: bool | None = None,
    model: ModelLike = None,
    device: str | torch.device | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Turns one or more line drawings of an object into a solid (paper, section 3).

    All drawings give a first prediction, and further rounds refine it; one drawing alone is refined as well. (The
    paper's networks take one drawing after the other: the first predicts, each other one updates.)

    Args:
        drawings: one drawing or a sequence of them; a drawing is a path, a PIL image, or an array [H, W] or
            [H, W, 3 or 4], dark on light or light on dark.
        views: a viewpoint's name (`sketchcore.VIEWPOINTS`) or a `sketchcore.Camera` for each drawing; None, for a
            single drawing only, guesses among the eight three-quarter views, and the cameras that the drawing's lines
            speak for where they speak against these, or where the best of them fills the outline poorly.
        iterations: rounds over all drawings, 0 or more; fewer are run where the solid has settled.
        tolerance: what that means: they stop after a round that moved fewer voxels to the other side of 0.5 than
            this share of those that are occupied; the first round, which moves most, may move 3.5 times as many
            with one drawing, and 12 times with several. At 0 they never stop early.
        align: True looks for the place, size and camera at which each drawing is the most plausible one of an object
            that is centred in the world, with a largest side of 1/1.2, and takes it so: drawings made by hand are off
            centre, too small or too large, and made from a few degrees beside their viewpoint. The result's `views`
            are the cameras that were found. That takes a second or two for each. None does it where a drawing is
            plainly out of place, False never.
        model: None for the weights inside the package, a path to weights, or a loaded model (`load_model`).
        device: None for CUDA where there is one, else the CPU.
        progress: called as `progress(round, iterations, probability)` after the first prediction (round 0) and
            after each round that is run.

    Raises:
        ValueError: for no drawings, a number of views that differs from that of drawings, a drawing that is none.
        KeyError: for an unknown viewpoint.
        TypeError: for what is no drawing or no view.
        FileNotFoundError: for a drawing or weights that do not exist.
    """
    several = isinstance(drawings, Sequence) and not isinstance(drawings, str | bytes)
    sources = list(drawings) if several else [drawings]
    if not sources:
        raise ValueError("reconstruct needs at least one drawing")
    if iterations < 0:
        raise ValueError(f"iterations must be 0 or more, got {iterations}")
    if not tolerance >= 0:
        raise ValueError(f"tolerance must be 0 or more, got {tolerance}")
    if views is None and len(sources) > 1:
        raise ValueError(f"{len(sources)} drawings need a view each; only a single drawing's view can be guessed")
    names = [views] if isinstance(views, str | Camera) else list(views or [])
    if views is not None and len(names) != len(sources):
        raise ValueError(f"each drawing needs a view: got {len(sources)} drawings, {len(names)} views")
    cameras = tuple(as_camera(view) for view in names)
    images = np.stack([load_drawing(source) for source in sources])
    chosen = load_model(model, device)
    guessed = None
    if not cameras:
        guessed, camera = guess_camera(chosen, images[0])
        cameras = (camera,)
    made = _run(Sketches(images, pack_cameras(cameras)), cameras, iterations, tolerance, align, chosen, progress)
    return replace(made, guessed=guessed)


def _run(
    sketches: Sketches,
    views: tuple[Camera, ...],
    iterations: int,
    tolerance: float,
    align: bool | None,
    model: Model,
    progress: Progress | None,
    start: Volume | None = None,
) -> Reconstruction:
    before: Volume | None = None
    trace: list[float] = []
    if align is not False:
        placed = model.in_place(sketches, always=align is True)
        if placed is not sketches:
            sketches, views = placed, tuple(Camera.from_packed(row) for row in placed.cameras)
    rounds = until_settled(model.rounds(sketches, iterations, start), tolerance, model.first(len(sketches)))
    for number, volume in enumerate(rounds):
        if progress is not None:
            progress(number, iterations, volume)
        if before is not None:
            trace.append(float(np.sqrt(np.mean((volume - before) ** 2))))
        before = volume
    assert before is not None
    return Reconstruction(before, views, tuple(trace), sketches.drawings, _model=model)


def load_model(model: ModelLike = None, device: str | torch.device | None = None) -> Model:
    """The weights inside the package (None), those at a path, or a model as it is.

    Raises:
        FileNotFoundError: if there are no such weights.
        ValueError: if they are damaged or of an unknown network, or there is no such device.
    """
    if model is None:
        return _pretrained(None if device is None else str(device))
    if isinstance(model, str | os.PathLike):
        return build_model(*load_weights(model), device=device)
    return model


@lru_cache(maxsize=2)
def _pretrained(device: str | None) -> Model:
    return build_model(*load_weights(PRETRAINED), device=device)
