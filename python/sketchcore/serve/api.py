"""The routes, and what they promise (OpenAPI)."""

# Annotations are read by FastAPI, and name the server's limits: they must be there, not be postponed.

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import Annotated, Any, Literal

from fastapi import FastAPI, File, Form, Request, Response, UploadFile
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from sketchcore import __version__
from sketchcore.asgi.files import MEDIA_TYPES, OTHER, attachment
from sketchcore.asgi.guard import Guard, TooLargeError
from sketchcore.asgi.sentences import error_response
from sketchcore.camera import VIEWPOINTS
from sketchcore.nets.model import Model
from sketchcore.serve.order import AbandonedError, Made, Order
from sketchcore.serve.service import BusyError, Limits, Service
from sketchcore.serve.views import Pinhole, read_view, told

DRAINED = 5.0
"""Seconds that the body of a refused request may take to come; clients that are still sending do not hear an answer."""

_UNKNOWN = "something went wrong on the server; its log says what"

_log = logging.getLogger(__name__)


class Sentence(BaseModel):
    """What is wrong, and what would be right."""

    error: str


class Alive(BaseModel):
    """The process answers."""

    status: Literal["alive"] = "alive"


class Ready(BaseModel):
    """A reconstruction would be taken on."""

    status: Literal["ready"] = "ready"
    taken: int = Field(description="Requests that are being served or wait.")
    seats: int = Field(description="The most of these that are taken on.")


class Viewpoint(BaseModel):
    """A named camera."""

    name: str
    camera: Pinhole


def _promised(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Errors of a route, for OpenAPI."""
    told_when: dict[int | str, str] = {
        400: "The body is not what its headers say.",
        403: "The server is not called by this name, or a page of another site asks.",
        408: "The body did not come in time.",
        413: "The request, or a drawing in it, is too large.",
        415: "The body is no multipart/form-data.",
        422: "What is asked for does not exist or does not fit together, or a drawing is none.",
        500: "Something went wrong that should not have; it is in the server's log.",
        503: "All seats are taken, or the server begins or ends.",
        504: "The file was not made in time.",
    }
    answers: dict[int | str, dict[str, Any]] = {
        status: {"model": Sentence, "description": told_when[status]} for status in statuses
    }
    if 503 in answers:
        again = {"description": "Seconds after which to try again.", "schema": {"type": "integer"}}
        answers[503]["headers"] = {"Retry-After": again}
    return answers


_FILE: dict[str, Any] = {
    "description": "The solid as a file.",
    "content": {
        media: {"schema": {"type": "string", "format": "binary"}}
        for media in dict.fromkeys([*(MEDIA_TYPES[f".{kind}"] for kind in ("glb", "obj", "stl")), OTHER])
    },
    "headers": {
        "Sketchcore-Views": {
            "description": "The camera of each drawing, as JSON; where it was looked for, the one that was found.",
            "schema": {"type": "string"},
        },
        "Sketchcore-Trace": {
            "description": "Root-mean-square change of the probability in each round that was run, as JSON.",
            "schema": {"type": "string"},
        },
        "Sketchcore-Guessed": {
            "description": "The viewpoint that is nearest to the camera, where none was given.",
            "schema": {"type": "string"},
        },
        "Server-Timing": {
            "description": "Milliseconds of waiting for a worker, and of work.",
            "schema": {"type": "string"},
        },
    },
}


def build_app(model: Model, limits: Limits | None = None, hosts: Iterable[str] | None = None) -> FastAPI:
    """The server as an ASGI app; its workers start at once, and end with it.

    Args:
        model: the network (`sketchcore.load_model`).
        limits: what is taken on.
        hosts: names that it may be called by; None for any.
    """
    limits = limits or Limits()
    service = Service(model, limits)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        yield
        service.close()

    app = FastAPI(
        title="sketchcore",
        version=__version__,
        summary="Line drawings in, a solid 3D shape out.",
        description="The world is right-handed with y up; an object is centred, fills the unit cube, faces +x and is "
        "symmetric about z = 0. Errors are said in a sentence.",
        lifespan=lifespan,
        docs_url=None,  # the page would fetch its script from elsewhere
        redoc_url=None,
    )
    app.state.service = service
    app.add_middleware(Guard, hosts=hosts, largest=limits.megabytes * 2**20)
    _say_errors(app)

    @app.get("/healthz", responses=_promised(403, 413), summary="Whether the process answers")
    async def healthz() -> Alive:
        return Alive()

    @app.get("/readyz", responses=_promised(403, 413, 503), summary="Whether a reconstruction would be taken on")
    async def readyz() -> Ready:
        if not service.warm:
            raise BusyError("the server is still loading its network", 1)
        service.check()
        return Ready(taken=service.taken, seats=service.seats)

    @app.get("/v1/viewpoints", responses=_promised(403, 413), summary="The named viewpoints and their cameras")
    async def viewpoints() -> list[Viewpoint]:
        return [Viewpoint(name=name, camera=Pinhole.of(camera)) for name, camera in VIEWPOINTS.items()]

    async def reconstruct(
        request: Request,
        drawings: Annotated[
            list[UploadFile],
            File(
                description="Line drawings of one object, dark on light or light on dark: PNG, JPEG, WebP, GIF, BMP, "
                "TIFF or PPM.",
                min_length=1,
                max_length=limits.drawings,
            ),
        ],
        views: Annotated[
            list[str],
            Form(
                description="A view for each drawing, in order: a viewpoint's name (GET /v1/viewpoints), or a camera "
                'as JSON, {"azimuth": 30, "elevation": 20} or in full as there. A single drawing\'s may be left out: '
                "it is looked for then.",
                max_length=limits.drawings,
            ),
        ] = [],  # noqa: B006, FastAPI copies it
        iterations: Annotated[
            int, Form(description="Rounds, at most; fewer where the solid has settled.", ge=0, le=limits.iterations)
        ] = min(5, limits.iterations),
        align: Annotated[
            bool | None,
            Form(
                description="true looks for the place, size and camera of each drawing, as one should for those made "
                "by hand; false takes them as they are; left out, it is looked for where a drawing is plainly out of "
                "place."
            ),
        ] = None,
        format: Annotated[
            Literal["glb", "obj", "stl", "ply", "npz", "binvox"],
            Form(description="glb, obj, stl, ply: a mesh; npz: probabilities, cameras and drawings; binvox: voxels."),
        ] = "glb",
    ) -> Response:
        order = Order(
            tuple([await drawing.read() for drawing in drawings]),
            tuple(read_view(view) for view in views),
            iterations,
            align,
            f".{format}",
            limits.megapixels,
        )
        request.state.received = True
        try:
            made = await _unless_gone(request, service.made(order))
        except AbandonedError:
            raise BusyError("the server is ending; ask again, or ask another", 5) from None
        except (KeyError, ValueError, TypeError):
            raise
        except Exception:
            _log.exception("a reconstruction failed")
            raise HTTPException(500, _UNKNOWN) from None
        if made is None:
            return Response(status_code=499)  # nobody hears it
        return attachment(made.content, "solid", order.suffix, made.headers)

    app.router.add_api_route(
        "/v1/reconstruct",
        reconstruct,
        methods=["POST"],
        response_class=Response,
        responses={200: _FILE, **_promised(400, 403, 408, 413, 415, 422, 500, 503, 504)},
        route_class_override=_seated(service),
        summary="A solid from drawings",
    )
    return app


async def _unless_gone(request: Request, work: Coroutine[Any, Any, Made]) -> Made | None:
    """What the work comes to; None, and an end of the work, if the client goes away before."""

    async def gone() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    made, leaving = asyncio.ensure_future(work), asyncio.ensure_future(gone())
    try:
        await asyncio.wait({made, leaving}, return_when=asyncio.FIRST_COMPLETED)
        return await made if made.done() else None
    finally:
        for task in (made, leaving):
            task.cancel()
        await asyncio.gather(made, leaving, return_exceptions=True)


def _seated(service: Service) -> type[APIRoute]:
    """Routes whose requests take a seat before their body is read, and keep it until they are answered."""

    class Route(APIRoute):
        def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
            handle = super().get_route_handler()

            async def seated(request: Request) -> Response:
                kind = request.headers.get("content-type", "")
                if kind.partition(";")[0].strip().lower() != "multipart/form-data":
                    raise HTTPException(415, f"drawings come as multipart/form-data, not as {kind[:40] or 'nothing'}")
                try:
                    with service.seat():
                        return await _in_time(handle, request, service.limits.seconds)
                except BusyError:
                    await _drain(request)
                    raise

            return seated

    return Route


async def _in_time(
    handle: Callable[[Request], Coroutine[Any, Any, Response]], request: Request, seconds: float
) -> Response:
    try:
        async with asyncio.timeout(seconds):
            return await handle(request)
    except TimeoutError:
        if getattr(request.state, "received", False):
            raise HTTPException(504, f"the solid was not made within {seconds:g} s; try again later") from None
        raise HTTPException(408, f"the drawings did not come within {seconds:g} s") from None


async def _drain(request: Request) -> None:
    """Takes in the body of a refused request, and drops it."""
    try:
        async with asyncio.timeout(DRAINED):
            while (message := await request.receive()).get("more_body") or message["type"] != "http.request":
                if message["type"] == "http.disconnect":
                    return
    except (TimeoutError, TooLargeError):
        pass


def _say_errors(app: FastAPI) -> None:
    """Every error is {"error": sentence}."""

    @app.exception_handler(BusyError)
    async def busy(request: Request, error: BusyError) -> Response:
        return error_response(503, error, {"Retry-After": str(error.again)})

    @app.exception_handler(HTTPException)
    async def http(request: Request, error: HTTPException) -> Response:
        if isinstance(error.__cause__, TooLargeError):  # FastAPI hides what was wrong while a body was read
            return error_response(413, error.__cause__)
        detail = str(error.detail or HTTPStatus(error.status_code).phrase)
        return error_response(error.status_code, detail, error.headers)

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        return error_response(422, told(error.errors()))

    @app.exception_handler(TooLargeError)
    async def too_large(request: Request, error: TooLargeError) -> Response:
        return error_response(413, error)

    async def senseless(request: Request, error: Exception) -> Response:
        return error_response(422, error)

    for kind in (KeyError, ValueError, TypeError):
        app.add_exception_handler(kind, senseless)

    @app.exception_handler(Exception)
    async def unknown(request: Request, error: Exception) -> Response:
        return error_response(500, _UNKNOWN)
