"""Networks ready for use: what a reconstruction calls, whichever architecture is behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import partial, reduce
from typing import Any, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from sketchcore.nets.compact import CompactConfig, CompactNet
from sketchcore.nets.decoder import fold
from sketchcore.nets.inference import CompactInference, flip_cells, whole
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.outlines import heed_outlines
from sketchcore.nets.pieces import join_pieces
from sketchcore.nets.precision import autocast, pick_device, place, unit
from sketchcore.nets.search import in_place
from sketchcore.nets.singleview import SingleViewModel
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.together import Passes
from sketchcore.nets.unet import PaperNet
from sketchcore.rounds import FIRST, Volume, update_rounds
from sketchcore.untrusted import reason

Net = TypeVar("Net", bound=nn.Module)


class Model(Protocol):
    """What turns drawings into a volume, round after round.

    Attributes:
        device: where it computes.
    """

    device: torch.device

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        """Yields float32 [64, 64, 64] (x, y, z), probability of occupancy, for the drawings of each object.

        It is what the network says, with nothing mended yet.
        """
        ...

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        """The drawings moved to where they belong, and their cameras, as far as the network can tell.

        It is looked for where they are plainly out of place; or `always`.
        """
        ...

    def first(self, drawings: int) -> float:
        """How many times the tolerance the first round may move where rounds end after it (`until_settled`)."""
        ...

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        """Yields float32 [64, 64, 64] (x, y, z), probability of occupancy: the first prediction, then each round's.

        `start` is a volume that was known before the first drawing.
        """
        ...


LOOKS: tuple[tuple[int, ...], ...] = ((), (0,), (0, 2), (2,))
"""Axes that the world is mirrored along in each of four rounds, over and over: what differs most comes first."""
BATCH = 8
"""Objects that first predictions are made of side by side."""


class CompactModel:
    """`CompactNet`: every round looks at all drawings together, and the rounds take turns at looking in a mirror.

    Mirrored, a world is seen by mirrored cameras in drawings flipped left to right. That describes the same object
    as well: about z = 0 because it is symmetric, along x because a mirrored object is an object too. The network
    answers each of the four descriptions a little differently, above all those that are mirrored along x from those
    that are not; the volume is the mean of all its answers, in which both kinds weigh the same, and each next
    round's prior. What is handed out has every outline filled (`outlines.py`), and its pieces joined
    (`pieces.py`).
    """

    def __init__(self, net: CompactNet, device: torch.device) -> None:
        self.net: Passes = CompactInference(net, device)
        self.device = device

    def by(self, passes: Passes) -> CompactModel:
        """The same model, its passes made by somebody else, such as `nets/together.py`."""
        other = copy(self)
        other.net = passes
        return other

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for first in range(0, len(samples), BATCH):
            batch = samples[first : first + BATCH]
            readings = self.net.read(batch, self.net.evidence(batch))
            for cells in self.net.decide(readings, None, [len(s) for s in batch]):
                yield whole(cells[None])

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return in_place(self.first_predictions, sketches, whole(self._look(sketches)[2]), always)

    def first(self, drawings: int) -> float:
        # Further rounds mend what one drawing leaves open; they mend nothing that several say (docs/training.md).
        return FIRST if drawings == 1 else 12.0

    def _look(self, sketches: Sketches) -> tuple[Tensor, Tensor, Tensor]:
        """The evidence of drawings, what is read in them, and what it says by itself."""
        if self not in sketches.kept:
            evidence = self.net.evidence([sketches])
            readings = self.net.read([sketches], evidence)
            sketches.kept[self] = evidence, readings, self.net.decide(readings, None, [len(sketches)])
        seen: tuple[Tensor, Tensor, Tensor] = sketches.kept[self]
        return seen

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        said: tuple[list[Tensor], list[Tensor]] = [], []  # of the world as it is, and mirrored along x
        known: Tensor | None = None
        if start is not None:
            half = 0.5 * (start + start[:, :, ::-1])[:, :, 32:]
            known = fold(torch.from_numpy(np.ascontiguousarray(half, np.float32)).to(self.device)[None, None])
        mean = known
        evidence, reading, answer = self._look(sketches)
        readings = {LOOKS[0]: reading}
        for number in range(iterations + 1):
            look = LOOKS[number % len(LOOKS)]
            turn = flip_cells if 0 in look else _as_it_is
            if look not in readings:
                readings[look] = self.net.read([reduce(Sketches.mirrored, look, sketches)], turn(evidence))
            prior = None if mean is None else turn(mean)
            if prior is not None:
                answer = turn(self.net.decide(readings[look], prior, [len(sketches)]))
            said[0 in look].append(answer)
            mean = torch.stack([torch.stack(kind).mean(dim=0) for kind in said if kind]).mean(dim=0)
            if known is not None:  # one prediction among those of the drawings
                mean = (known + (number + 1) * mean) / (number + 2)
            yield join_pieces(heed_outlines(whole(mean), sketches))


def _as_it_is(cells: Tensor) -> Tensor:
    return cells


class PaperModel:
    """The paper's single-view network and its updater, one drawing after the other (`rounds.py`)."""

    def __init__(self, single: PaperNet, updater: PaperNet | None, device: torch.device) -> None:
        self.single = place(single, device).eval()
        self.updater = None if updater is None else place(updater, device).eval()
        self.device = device

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            yield next(self.rounds(sketches, 0))

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return FIRST

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        return update_rounds(
            lambda view, prior: self.predict(sketches.drawings[view], prior), sketches.cameras, iterations, start
        )

    @torch.inference_mode()
    def predict(self, drawing: NDArray[np.uint8], prior: Volume | None) -> Volume:
        """Occupancy of one drawing's camera grid, float32 [64, 64, 64] (depth, row, col), given a prior in it or None.

        Raises:
            ValueError: for a prior, if there is no updater.
        """
        image = unit(drawing[None, None], self.device)
        with autocast(self.device):
            if prior is None:
                logits = self.single(image)
            elif self.updater is None:
                raise ValueError("these weights hold the single-view network alone; train the updater as well")
            else:
                logits = self.updater(image, torch.from_numpy(prior).to(self.device)[None])
        volume: Volume = PaperNet.probability(logits.float())[0].contiguous().cpu().numpy()
        return volume


def build_model(
    state: dict[str, Tensor], config: dict[str, Any], device: str | torch.device | None = None
) -> CompactModel | PaperModel | SingleViewModel:
    """The model of stored weights (`nets/weights.py`).

    Raises:
        ValueError: if the config names no known network, or the weights do not fit it.
    """
    chosen = pick_device(device)
    kind, options = config.get("network"), config.get("options", {})
    if not isinstance(options, dict):
        raise ValueError(f"the options of a network are an object in the config, got {type(options).__name__}")
    if kind == "compact":
        return CompactModel(_made(lambda: CompactNet(CompactConfig.of_options(options)), state, kind), chosen)
    if kind == "paper":
        parts = sorted({name.split(".", 1)[0] for name in state})
        if parts not in (["single"], ["single", "updater"]):
            raise ValueError(f"weights of the network 'paper' hold 'single' and 'updater', got {parts[:5]}")
        single, *updater = (
            _made(
                partial(PaperNet, **{**options, "updater": part == "updater"}),
                {name.removeprefix(f"{part}."): t for name, t in state.items() if name.startswith(f"{part}.")},
                kind,
            )
            for part in parts
        )
        return PaperModel(single, updater[0] if updater else None, chosen)
    if kind == "multiscale":
        return SingleViewModel(_made(lambda: MultiscaleNet(**options), state, kind), chosen)
    raise ValueError(f"unknown network {kind!r:.80} in the config; 'compact', 'paper' and 'multiscale' are known")


def _made(make: Callable[[], Net], state: dict[str, Tensor], kind: str) -> Net:
    """A network with its weights: these very tensors, which are not copied.

    It is made without memory first. So a config can ask for no more than is in the file of its weights.
    """
    try:
        with torch.device("meta"), _Unfilled():
            expected = make().state_dict()
    except (TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        raise ValueError(
            f"the config is wrong, or of another version of the network {kind!r}: {reason(error)}"
        ) from error
    for name, like in expected.items():
        given = state.get(name)
        if given is None:
            raise ValueError(f"the weights do not fit the network of their config: there is no {name}")
        if given.shape != like.shape or given.is_floating_point() != like.is_floating_point():
            sides, has = list(like.shape), f"{list(given.shape)[:8]} of {given.dtype}"
            raise ValueError(f"the weights do not fit the network of their config: {name} must be {sides}, got {has}")
    if unknown := sorted(set(state) - set(expected)):
        raise ValueError(f"the weights do not fit the network of their config: it has no {unknown[0][:80]}")
    with _Unfilled():
        net = make()
    net.load_state_dict(state, assign=True)
    return net


class _Unfilled(TorchFunctionMode):
    """Networks are made without their random beginnings: memory that is never written to takes no room."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if func in _FILLS or getattr(func, "__module__", None) == "torch.nn.init":
            return args[0] if args else kwargs["tensor"]
        return func(*args, **(kwargs or {}))


_FILLS = {Tensor.uniform_, Tensor.normal_, Tensor.zero_, Tensor.fill_}
