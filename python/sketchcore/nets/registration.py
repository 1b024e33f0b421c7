"""How a drawing lies to its camera: off centre, too large or too small, seen from a little elsewhere.

People do not draw an object exactly where a camera would show it, and the networks read drawings exactly there. A
network of its own looks at a drawing and at the camera that it claims, and says what is between them.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.camera import Camera
from sketchcore.grids import IMAGE
from sketchcore.nets.blocks import Attention, Block

UNITS = (0.1, 10.0, 10.0, 5.0, 5.0, 5.0)
"""What the network's outputs are counted in: logarithm of scale, pixels right and down, degrees about the camera's x, y
and z axes."""
POSE = 13
"""Numbers that describe a camera to the network, see `describe`."""


@dataclass(frozen=True)
class RegistrationConfig:
    """Widths (channels) of `RegistrationNet` at 64^2, 32^2, 16^2 and 8^2 pixels, and groups of its normalisations."""

    width: tuple[int, int, int, int] = (48, 64, 128, 192)
    groups: int = 8


class RegistrationNet(nn.Module):
    """A drawing and a camera in; how the drawing lies to the camera out, and how far off that may be."""

    def __init__(self, config: RegistrationConfig | None = None) -> None:
        super().__init__()
        self.config = config or RegistrationConfig()
        (w64, w32, w16, w8), groups, code = self.config.width, self.config.groups, 64
        self.condition = nn.Sequential(nn.Linear(POSE, code), nn.ReLU(), nn.Linear(code, code), nn.ReLU())
        self.into = nn.Conv2d(16, w64, 3, padding=1)
        self.down32 = nn.Conv2d(w64, w32, 3, stride=2, padding=1)
        self.at32 = Block(nn.Conv2d, w32, groups, code)
        self.down16 = nn.Conv2d(w32, w16, 3, stride=2, padding=1)
        self.at16 = nn.ModuleList([Block(nn.Conv2d, w16, groups, code) for _ in range(2)])
        self.down8 = nn.Conv2d(w16, w8, 3, stride=2, padding=1)
        self.at8 = nn.ModuleList([Block(nn.Conv2d, w8, groups, code) for _ in range(2)])
        self.attention = Attention(w8, 8 * 8)
        self.narrow = nn.Conv2d(w8, 32, 1)
        self.head = nn.Sequential(nn.Linear(32 * 64 + code, 256), nn.ReLU(), nn.Linear(256, 2 * len(UNITS)))

    def forward(self, drawing: Tensor, pose: Tensor) -> tuple[Tensor, Tensor]:
        """Estimates each drawing's registration.

        Args:
            drawing: float [B, 256, 256], ink 1 on 0.
            pose: float [B, 13], `describe` of the camera that each claims.

        Returns:
            float32 [B, 6], the estimate in `UNITS`; float32 [B, 6], the logarithm of its mean absolute error.
        """
        code = self.condition(pose)
        x = F.relu(self.into(F.pixel_unshuffle(drawing[:, None], 4).contiguous(memory_format=torch.channels_last)))
        x = self.at32(self.down32(x), code)
        x = self.down16(F.relu(x))
        for block in self.at16:
            x = block(x, code)
        x = self.down8(F.relu(x))
        for block in self.at8:
            x = block(x, code)
        x = self.narrow(F.relu(self.attention(x)))
        mean, spread = self.head(torch.cat([F.relu(x).flatten(1), code.to(x.dtype)], dim=1)).float().chunk(2, dim=1)
        return mean, spread

    def describe(self) -> dict[str, object]:
        """The configuration as plain data, for the file beside the weights."""
        return asdict(self.config)


def describe(camera: Camera) -> NDArray[np.float32]:
    """float32 [13]: a camera's rotation, where it sees the origin, how large a ball there, and its field of view."""
    right, down, away = -camera.rotation @ camera.position
    tangent = np.tan(np.radians(camera.fov_degrees / 2))
    image = [right / (away * tangent), down / (away * tangent), 1 / (away * tangent), tangent]
    return np.concatenate([camera.rotation.ravel(), image]).astype(np.float32)


def origin(camera: Camera) -> NDArray[np.float64]:
    """float64 [2]: the pixel (x, y) at which a camera sees the world's origin."""
    right, down, away = -camera.rotation @ camera.position
    focal = IMAGE / 2 / np.tan(np.radians(camera.fov_degrees / 2))
    at: NDArray[np.float64] = IMAGE / 2 - 0.5 + focal * np.array([right, down]) / away
    return at


def rotated(camera: Camera, degrees: NDArray[np.float64]) -> Camera:
    """The camera turned about the world's origin, which stays where it is in the image.

    Args:
        camera: to be turned.
        degrees: float64 [3], rotation vector in the camera's axes.
    """
    angle = float(np.linalg.norm(degrees))
    x, y, z = degrees / max(angle, 1e-9)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(angle)
    turn = np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross
    rotation = turn @ camera.rotation
    middle = -camera.rotation @ camera.position
    return Camera(-rotation.T @ middle, rotation, camera.fov_degrees, camera.near, camera.far)
