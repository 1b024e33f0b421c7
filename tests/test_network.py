"""The compact network without torch says what it says with torch, and refuses what does not fit."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

from sketchcore import _core
from sketchcore.datagen import generate
from sketchcore.nets.compact import CompactNet, read_inputs
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.decoder import fold
from sketchcore.nets.filled import filled
from sketchcore.nets.sketches import Sketches

TINY = CompactConfig(stem=8, image=(16, 16, 16), features=8, fused=8, world=(8, 16, 16), groups=2)
ODD = CompactConfig(stem=11, image=(12, 20, 40), features=3, fused=7, world=(4, 12, 24), groups=4)
SHIPPED = CompactConfig()
CONFIGS = {"tiny": TINY, "odd": ODD, "shipped": SHIPPED}
PRETRAINED = str(files("sketchcore") / "pretrained" / "compact.safetensors")
CPU = torch.device("cpu")

Weights = dict[str, NDArray[np.float32]]


def made(weights: Weights, config: CompactConfig) -> _core.CompactNetwork:
    return _core.CompactNetwork(weights, **asdict(config))


def weights_of(net: CompactNet) -> Weights:
    return {name: np.ascontiguousarray(tensor.numpy()) for name, tensor in net.state_dict().items()}


@cache
def awake(config: CompactConfig) -> CompactNet:
    """A network without the zeros that a new one starts from: every path matters, and the answer is no constant."""
    torch.manual_seed(1)
    net = CompactNet(config).eval()
    for parameter in net.parameters():
        parameter.requires_grad_(False).add_(torch.randn(parameter.shape) * 0.03 + 0.01)
    return net


@cache
def shipped() -> CompactNet:
    net = CompactNet(SHIPPED).eval().requires_grad_(False)
    net.load_state_dict({name: torch.from_numpy(w.astype(np.float32)) for name, w in load_file(PRETRAINED).items()})
    return net


@cache
def both(name: str) -> tuple[CompactNet, _core.CompactNetwork]:
    net = shipped() if name == "shipped" else awake(CONFIGS[name])
    return net, made(weights_of(net), net.config)


@cache
def samples(counts: tuple[int, ...]) -> list[Sketches]:
    batch = generate(5, len(counts), views=max(counts))
    cameras = batch.packed_cameras
    return [Sketches(batch.drawings[i, :n], np.ascontiguousarray(cameras[i, :n])) for i, n in enumerate(counts)]


def arguments(sketches: list[Sketches]) -> dict[str, Any]:
    return {
        "drawings": np.concatenate([s.drawings for s in sketches]),
        "fields": np.concatenate([s.fields for s in sketches]),
        "cameras": np.concatenate([s.cameras for s in sketches]),
        "counts": [len(s) for s in sketches],
        "evidence": np.stack([s.evidence for s in sketches]),
    }


def a_prior(objects: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(3)
    return rng.random((objects, 64, 64, 32), np.float32)


def by_torch(net: CompactNet, sketches: list[Sketches], prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
    """Logits, float32 [B, 32, 32, 16, 8]."""
    objects = len(sketches)
    evidence = torch.from_numpy(np.stack([s.evidence for s in sketches])).float() / 255
    with torch.inference_mode():
        logits = net(
            **read_inputs(sketches, CPU),
            evidence=evidence,
            prior=torch.zeros(objects, 64, 64, 32) if prior is None else torch.from_numpy(prior),
            has_prior=torch.full((objects,), float(prior is not None)),
        )
        return fold(logits[:, None]).numpy()


def in_cells(volume: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.ascontiguousarray(fold(torch.from_numpy(volume)[:, None]).numpy())


@pytest.mark.parametrize("with_prior", [False, True])
@pytest.mark.parametrize("counts", [(1,), (2,), (3, 1, 2)])
@pytest.mark.parametrize("name", CONFIGS)
def test_it_says_what_torch_says(name: str, counts: tuple[int, ...], with_prior: bool) -> None:
    net, ours = both(name)
    sketches = samples(counts)
    prior = a_prior(len(counts)) if with_prior else None
    logits = by_torch(net, sketches, prior)
    assert logits.std() > 0.05, "a network that says the same everywhere shows nothing"
    readings = ours.read(**arguments(sketches))
    assert readings.shape == (len(counts), 32 * 32 * 16, net.config.world[0] + 8)
    said = ours.decide(readings, None if prior is None else in_cells(prior), list(counts))
    assert said.shape == (len(counts), 32, 32, 16, 8)
    np.testing.assert_allclose(said, 1 / (1 + np.exp(-logits.astype(np.float64))), atol=1e-4)
    sure = np.clip(said, 1e-3, 1 - 1e-3).astype(np.float64)
    np.testing.assert_allclose(np.log(sure / (1 - sure)), np.clip(logits, *np.log([1 / 999, 999])), atol=2e-3)


def test_readings_are_the_first_layer_without_the_prior() -> None:
    net, ours = both("odd")
    sketches = samples((2, 1))
    given = arguments(sketches)
    with torch.inference_mode():
        inputs = read_inputs(sketches, CPU)
        seen = net.read(**inputs)
        evidence = fold(torch.from_numpy(given["evidence"]).float() / 255)
        place = net.decoder.place.expand(2, -1, -1, -1, -1)
        x = torch.cat([seen, evidence, torch.zeros(2, 32, 32, 16, 8), place], dim=-1).permute(0, 4, 1, 2, 3)
        layers = [layer(x).permute(0, 2, 3, 4, 1) for layer in (net.decoder.into, net.decoder.shortcut)]
        expected = torch.cat(layers, dim=-1).flatten(1, 3).numpy()
    np.testing.assert_allclose(ours.read(**given), expected, atol=1e-3)


def test_a_batch_says_what_its_objects_say_alone() -> None:
    _, ours = both("tiny")
    sketches = samples((3, 1, 2))
    prior = in_cells(a_prior(3))
    readings = ours.read(**arguments(sketches))
    together = ours.decide(readings, prior, [3, 1, 2])
    for i, own in enumerate(sketches):
        alone = ours.read(**arguments([own]))
        np.testing.assert_array_equal(alone[0], readings[i])
        np.testing.assert_array_equal(ours.decide(alone, prior[i : i + 1], [len(own)])[0], together[i])


def test_no_objects_are_nothing() -> None:
    _, ours = both("tiny")
    nothing = ours.read(
        np.zeros((0, 256, 256), np.uint8),
        np.zeros((0, 256, 256, 2), np.uint8),
        np.zeros((0, 15)),
        [],
        np.zeros((0, 3, 64, 64, 32), np.uint8),
    )
    assert nothing.shape == (0, 16384, 16)
    assert ours.decide(nothing, None, []).shape == (0, 32, 32, 16, 8)


def test_threads_at_once_say_the_same() -> None:
    _, ours = both("tiny")
    given = [arguments(samples(counts)) for counts in [(1,), (2,), (3, 1, 2)]]

    def say(i: int) -> NDArray[np.float32]:
        own = given[i % len(given)]
        return ours.decide(ours.read(**own), None, own["counts"])

    alone = [say(i) for i in range(len(given))]
    with ThreadPoolExecutor(6) as pool:
        for i, said in enumerate(pool.map(say, range(12))):
            np.testing.assert_array_equal(said, alone[i % len(given)])


SAY = """
import sys
import numpy as np
from sketchcore import _core
stored = dict(np.load(sys.argv[1]))
weights = {name[1:]: stored.pop(name) for name in list(stored) if name[0] == "/"}
counts = stored.pop("counts").tolist()
prior = stored.pop("prior")
widths = eval(sys.argv[2])
network = _core.CompactNetwork(weights, **widths)
said = network.decide(network.read(counts=counts, **stored), prior, counts)
np.save(sys.stdout.buffer, said)
assert "torch" not in sys.modules
"""


def test_any_number_of_threads_says_the_same_and_none_needs_torch(tmp_path: Any) -> None:
    net, ours = both("tiny")
    given, prior = arguments(samples((2, 1))), in_cells(a_prior(2))
    stored: dict[str, Any] = {f"/{name}": weight for name, weight in weights_of(net).items()}
    np.savez(tmp_path / "in.npz", **{**stored, **given, "prior": prior})
    expected = ours.decide(ours.read(**given), prior, given["counts"])
    for threads in (1, 3):
        answer = subprocess.run(
            [sys.executable, "-c", SAY, str(tmp_path / "in.npz"), repr(asdict(TINY))],
            env={**os.environ, "RAYON_NUM_THREADS": str(threads)},
            capture_output=True,
            check=True,
        ).stdout
        (tmp_path / "out.npy").write_bytes(answer)
        np.testing.assert_array_equal(np.load(tmp_path / "out.npy"), expected)


def test_what_is_not_a_number_spreads_and_breaks_nothing() -> None:
    net, ours = both("tiny")
    readings = ours.read(**arguments(samples((1,))))
    for strange in (np.nan, np.inf, -np.inf, np.float32(3e38)):
        odd = readings.copy()
        odd[0, 5000] = strange
        assert ours.decide(odd, None, [1]).shape == (1, 32, 32, 16, 8)
        prior = np.full((1, 32, 32, 16, 8), strange, np.float32)
        assert ours.decide(readings, prior, [1]).shape == (1, 32, 32, 16, 8)
    broken = {name: np.full_like(w, np.nan) for name, w in weights_of(net).items()}
    sick = made(broken, TINY)
    assert np.isnan(sick.decide(sick.read(**arguments(samples((1,)))), None, [1])).all()


def whole(message: str) -> str:
    return f"^{re.escape(message)}$"


def without(name: str) -> Weights:
    weights = weights_of(both("tiny")[0])
    del weights[name]
    return weights


def changed(name: str, weight: Any) -> Weights:
    return {**weights_of(both("tiny")[0]), name: weight}


ENCODER = "encoder.attention.into.weight"
MISFITS: dict[str, tuple[Weights, str]] = {
    "missing": (without("decoder.up32.bias"), "there is no decoder.up32.bias"),
    "other sides": (
        changed(ENCODER, np.zeros((16, 48), np.float32)),
        f"{ENCODER} must be [48, 16], got [16, 48] of float32",
    ),
    "one side": (changed("reading.bias", np.zeros((), np.float32)), "reading.bias must be [8], got [] of float32"),
    "many sides": (
        changed("reading.bias", np.zeros([1] * 20, np.float32)),
        "reading.bias must be [8], got [1, 1, 1, 1, 1, 1, 1, 1] of float32",
    ),
    "other numbers": (changed("reading.bias", np.zeros(8, np.int64)), "reading.bias must be [8], got [8] of int64"),
    "too many": (changed("encoder.zeal", np.zeros(1, np.float32)), "it has no encoder.zeal"),
    "the first of too many, cut": ({**changed("z" * 200, np.zeros(1, np.float32))}, "it has no " + "z" * 80),
}


@pytest.mark.parametrize("case", MISFITS)
def test_weights_that_do_not_fit_are_refused(case: str) -> None:
    weights, fault = MISFITS[case]
    with pytest.raises(ValueError, match=whole(f"the weights do not fit the network of their config: {fault}")):
        made(weights, TINY)


def test_it_is_said_as_for_torch() -> None:
    weights = without("encoder.attention.place")
    with pytest.raises(ValueError, match="there is no") as theirs:
        filled(lambda: CompactNet(TINY), weights, "compact")
    with pytest.raises(ValueError, match=whole(str(theirs.value))):
        made(weights, TINY)


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"stem": 0}, "stem must be whole, 1 to 4096, got 0"),
        ({"world": (8, 16, 5000)}, "world must be whole, 1 to 4096, got 5000"),
        ({"groups": 3}, "a width of 16 cannot be shared by 3 groups"),
        ({"image": (16, 16, 12)}, "a width of 12 cannot be shared by 8 attention heads"),
        ({"world": (8, 16, 18)}, "a width of 18 cannot be shared by 8 attention heads"),
    ],
)
def test_widths_that_no_network_has_are_refused(options: dict[str, Any], fault: str) -> None:
    with pytest.raises(ValueError, match=whole(fault)):
        _core.CompactNetwork(weights_of(both("tiny")[0]), **{**asdict(TINY), **options})


def test_a_config_takes_no_memory_that_its_weights_do_not() -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    greedy = replace(TINY, stem=4096, image=(4096, 4096, 4096), features=4096, fused=4096, world=(4096, 4096, 4096))
    with pytest.raises(ValueError, match="must be"):
        made(weights_of(both("tiny")[0]), greedy)
    with pytest.raises(ValueError, match="there is no"):
        made({}, greedy)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**15, "in KiB"


def test_weights_are_arrays_in_c_order() -> None:
    fortran = np.asfortranarray(weights_of(both("tiny")[0])[ENCODER])
    with pytest.raises(ValueError, match=rf"{ENCODER} must be C-contiguous; numpy.ascontiguousarray makes it so"):
        made(changed(ENCODER, fortran), TINY)
    with pytest.raises(TypeError):
        made(changed(ENCODER, "a weight"), TINY)


BAD_READ: dict[str, tuple[dict[str, Any], str]] = {
    "small drawings": (
        {"drawings": np.zeros((3, 64, 64), np.uint8)},
        "drawings must have shape [n, 256, 256], got [3, 64, 64]",
    ),
    "few drawings": (
        {"drawings": np.zeros((2, 256, 256), np.uint8)},
        "drawings must have shape one for each of the 3 others, got 2",
    ),
    "one field": (
        {"fields": np.zeros((3, 256, 256), np.uint8)},
        "fields must have shape [n, 256, 256, 2], got [3, 256, 256]",
    ),
    "few fields": (
        {"fields": np.zeros((1, 256, 256, 2), np.uint8)},
        "fields must have shape one for each of the 3 others, got 1",
    ),
    "short cameras": ({"cameras": np.zeros((3, 12))}, "cameras must have shape [n, 15], got [3, 12]"),
    "no cameras": ({"cameras": np.zeros((3, 15))}, "camera rotation must be orthonormal"),
    "evidence of whole worlds": (
        {"evidence": np.zeros((2, 3, 64, 64, 64), np.uint8)},
        "evidence must have shape [n, 3, 64, 64, 32], got [2, 3, 64, 64, 64]",
    ),
    "evidence of one": (
        {"evidence": np.zeros((1, 3, 64, 64, 32), np.uint8)},
        "evidence must have shape one for each of the 2 others, got 1",
    ),
    "counts": ({"counts": [2, 2]}, "counts must add up to the number of drawings, 3; got [2, 2]"),
    "huge counts": ({"counts": [2**63, 2**63]}, "counts must add up to the number of drawings, 3; got ["),
    "none": ({"counts": [3, 0]}, "each object needs at least one drawing; object 1 has none"),
}


@pytest.mark.parametrize("case", BAD_READ)
def test_what_cannot_be_read_is_refused(case: str) -> None:
    change, fault = BAD_READ[case]
    with pytest.raises(ValueError, match="^" + re.escape(fault)):
        both("tiny")[1].read(**{**arguments(samples((2, 1))), **change})


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            {"readings": np.zeros((2, 16384, 40), np.float32)},
            "readings must have shape [n, 16384, 16], got [2, 16384, 40]",
        ),
        ({"counts": [1]}, "readings must have shape one for each of the 1 others, got 2"),
        ({"counts": [1, 0]}, "each object needs at least one drawing; object 1 has none"),
        (
            {"prior": np.zeros((2, 64, 64, 32), np.float32)},
            "prior must have shape [n, 32, 32, 16, 8], got [2, 64, 64, 32]",
        ),
        (
            {"prior": np.zeros((1, 32, 32, 16, 8), np.float32)},
            "prior must have shape one for each of the 2 others, got 1",
        ),
        (
            {"prior": np.zeros((2, 32, 32, 8, 16), np.float32).swapaxes(3, 4)},
            "prior must be C-contiguous; numpy.ascontiguousarray makes it so",
        ),
    ],
)
def test_what_cannot_be_decided_on_is_refused(change: dict[str, Any], fault: str) -> None:
    given: dict[str, Any] = {"readings": np.zeros((2, 16384, 16), np.float32), "prior": None, "counts": [1, 2]}
    with pytest.raises(ValueError, match=whole(fault)):
        both("tiny")[1].decide(**{**given, **change})


def test_numbers_of_another_kind_are_refused() -> None:
    _, ours = both("tiny")
    given = arguments(samples((1,)))
    for name, kind in {"drawings": np.float32, "fields": np.int8, "cameras": np.float32, "evidence": bool}.items():
        with pytest.raises(TypeError):
            ours.read(**{**given, name: given[name].astype(kind)})
    with pytest.raises(TypeError):
        ours.decide(np.zeros((1, 16384, 16)), None, [1])  # type: ignore[arg-type]


def test_weights_on_disk_need_no_torch_either(tmp_path: Any) -> None:
    weights = weights_of(both("tiny")[0])
    save_file(weights, str(tmp_path / "w.safetensors"))
    again = made(load_file(str(tmp_path / "w.safetensors")), TINY)
    given = arguments(samples((1,)))
    np.testing.assert_array_equal(again.read(**given), both("tiny")[1].read(**given))
