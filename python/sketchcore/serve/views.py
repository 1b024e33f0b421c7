"""Cameras as requests and answers say them: by name, by angles, or in full."""

from __future__ import annotations

import json
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sketchcore.camera import FAR, FOV_DEGREES, NEAR, Camera, as_camera

Row = Annotated[list[float], Field(min_length=3, max_length=3)]


class Orbit(BaseModel):
    """A camera that looks at the origin."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    azimuth: float = Field(description="Degrees from +x towards +z.")
    elevation: float = Field(description="Degrees above the horizon.")
    distance: float | None = Field(None, description="From the origin; if left out, what the field of view asks for.")
    fov_degrees: float = Field(FOV_DEGREES, description="Field of view in degrees.")


class Pinhole(BaseModel):
    """A camera in full. The image is square, the camera's axes are x right, y down, z forward."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    position: Row = Field(description="The eye, in world units.")
    rotation: Annotated[list[Row], Field(min_length=3, max_length=3)] = Field(
        description="Its rows are the camera's x, y and z axes in the world."
    )
    fov_degrees: float = Field(FOV_DEGREES, description="Field of view in degrees.")
    near: float = Field(NEAR, description="Distance of the first plane of the camera grid.")
    far: float = Field(FAR, description="Distance of the last plane of the camera grid.")

    @classmethod
    def of(cls, camera: Camera) -> Pinhole:
        """What a camera is."""
        return cls(
            position=camera.position.tolist(),
            rotation=camera.rotation.tolist(),
            fov_degrees=float(camera.fov_degrees),
            near=float(camera.near),
            far=float(camera.far),
        )


def read_view(text: str) -> Camera:
    """The camera of a viewpoint's name, or of JSON: {"azimuth": 30, "elevation": 20}, or a whole camera (`Pinhole`).

    Raises:
        KeyError: for an unknown name.
        ValueError: for anything else that is no camera.
    """
    if not text.lstrip().startswith("{"):
        return as_camera(text)
    try:
        said = json.loads(text)
        if "rotation" in said:
            full = Pinhole.model_validate(said)
            return Camera(full.position, full.rotation, full.fov_degrees, full.near, full.far)  # type: ignore[arg-type]
        orbit = Orbit.model_validate(said)
    except ValidationError as error:
        raise ValueError(f"a view is no camera: {told(error.errors())}") from None
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"a view is a viewpoint's name or a camera as JSON; this is none: {error}") from None
    return Camera.orbit(orbit.azimuth, orbit.elevation, orbit.distance, fov_degrees=orbit.fov_degrees)


def told(errors: object) -> str:
    """What pydantic found wrong, in a line."""
    assert isinstance(errors, list | tuple)
    places = (".".join(str(part) for part in one["loc"] if part != "body") for one in errors)
    return "; ".join(f"{place}: {one['msg']}" for place, one in zip(places, errors, strict=True))[:500]
