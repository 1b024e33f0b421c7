"""The compact network as a reconstruction runs it is the network that was trained."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore.evaluate.testset import load_testset
from sketchcore.nets import cells
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.compactmodel import BATCH, CompactModel
from sketchcore.nets.decoder import fold
from sketchcore.nets.filled import filled
from sketchcore.nets.inference import CompactInference
from sketchcore.nets.native import CompactNative
from sketchcore.nets.passes import Passes
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.weights import PRETRAINED, load_weights
from sketchcore.rounds import crossing
from sketchcore.train.chains import Chain, compact_inputs
from test_compact import CPU, TINY, awake, chains

BOUNDS = {torch.float32: 1e-5, torch.bfloat16: 0.05, None: 1e-4}
"""How far probabilities may be off: of 2^-24 and 2^-9 a rounding, through some forty layers; None is without torch,
where convolutions take fewer products (Winograd's)."""


def native(net: CompactNet) -> CompactNative:
    return CompactNative({name: tensor.numpy() for name, tensor in net.state_dict().items()}, net.config)


def both(net: CompactNet, batch: list[Chain], dtype: torch.dtype | None) -> list[np.ndarray]:
    """Probabilities [B, 64, 64, 32] by the network itself in float32, and by its inference."""
    with torch.inference_mode():
        plain = net(**compact_inputs(batch, CPU)).sigmoid()
    ours: Passes = native(net) if dtype is None else CompactInference(net, CPU, dtype)
    samples = [chain.sketches for chain in batch]
    prior = np.stack([cells.fold(chain.prior) for chain in batch])
    made = ours.decide(ours.read(samples), prior if batch[0].depth else None, [len(s) for s in samples])
    assert (made.shape, made.dtype) == ((len(batch), 32, 32, 16, 8), np.float32)
    return [plain.numpy(), np.stack([cells.whole(one)[:, :, 32:] for one in made])]


@pytest.mark.parametrize("dtype", BOUNDS)
@pytest.mark.parametrize("depth", [0, 1])
@pytest.mark.parametrize("counts", [(1,), (2, 1, 4)])
def test_it_answers_as_the_network_does(counts: tuple[int, ...], depth: int, dtype: torch.dtype | None) -> None:
    plain, ours = both(awake(CompactNet(TINY)), chains(counts, depth), dtype)
    assert plain.std() > 0.05, "a network that says the same everywhere shows nothing"
    np.testing.assert_allclose(ours, plain, atol=BOUNDS[dtype])


@pytest.mark.parametrize("dtype", BOUNDS)
def test_the_weights_that_ship_lose_nothing(dtype: torch.dtype | None) -> None:
    weights, _ = load_weights(PRETRAINED)
    net = filled(CompactNet, weights, "compact")
    plain, ours = both(net.eval(), chains((1, 3)), dtype)
    assert np.abs(plain - ours).mean() < 0.01 * BOUNDS[dtype] / 0.05
    assert crossing(plain, ours) < 0.01


def test_the_network_stays_as_it_is() -> None:
    net = awake(CompactNet(TINY))
    before = {name: value.clone() for name, value in net.state_dict().items()}
    CompactInference(net, CPU)
    assert all(p.requires_grad for p in net.parameters())
    for name, value in net.state_dict().items():
        assert value.dtype == torch.float32
        torch.testing.assert_close(value, before[name], rtol=0, atol=0)


def test_first_predictions_side_by_side_are_those_one_by_one() -> None:
    model = CompactModel(native(awake(CompactNet(TINY))))
    samples = [chain.sketches for chain in chains((1, 2) * (BATCH // 2) + (3,))]
    together = list(model.first_predictions(samples))
    assert len(together) == len(samples) > BATCH
    for sketches, volume in zip(samples, together, strict=True):
        assert (volume.shape, volume.dtype) == ((64, 64, 64), np.float32)
        [alone] = model.first_predictions([sketches])
        np.testing.assert_allclose(volume, alone, atol=BOUNDS[None])


def test_cells_are_the_networks() -> None:
    half = np.random.default_rng(0).random((64, 64, 32), np.float32)
    folded = cells.fold(half)
    np.testing.assert_array_equal(folded, fold(torch.from_numpy(half)[None, None])[0].numpy())
    made = cells.whole(folded)
    np.testing.assert_array_equal(made[:, :, 32:], half)
    np.testing.assert_array_equal(made, made[:, :, ::-1])
    np.testing.assert_array_equal(cells.flip(folded), cells.fold(half[::-1]))


def test_drawings_seen_by_other_cameras_are_the_same_drawings() -> None:
    example = next(load_testset(1))
    sketches = Sketches(example.drawings[:1], example.cameras[0].packed[None])
    other = sketches.seen_by(example.cameras[1].packed[None])
    fresh = Sketches(sketches.drawings, other.cameras)
    assert other.fields is sketches.fields
    np.testing.assert_array_equal(other.fields, fresh.fields)
    np.testing.assert_array_equal(other.evidence, fresh.evidence)
    assert (other.evidence != sketches.evidence).any()


def test_mirrored_drawings_have_mirrored_fields() -> None:
    for example in load_testset(5):
        sketches = Sketches(example.drawings, np.stack([camera.packed for camera in example.cameras]))
        mirrored = sketches.mirrored(0)
        fresh = Sketches(mirrored.drawings, mirrored.cameras)
        np.testing.assert_array_equal(mirrored.fields, fresh.fields)
        np.testing.assert_array_equal(mirrored.mirrored(0).fields, sketches.fields)


def test_a_viewpoint_is_as_plausible_among_others_as_alone() -> None:
    from sketchcore.nets.placement import expected_iou
    from sketchcore.outline import outline_iou
    from sketchcore.perspective import Lines
    from sketchcore.viewpoint import guess_viewpoint

    example = next(load_testset(1))
    model, drawing = sk.load_model(), example.drawings[0]

    def alone(name: str) -> float:
        """Its outline, a quarter of its confidence, and a hundredth of what lines say."""
        camera = sk.VIEWPOINTS[name]
        [volume] = model.first_predictions([Sketches(drawing[None], camera.packed[None])])
        lines = float(Lines.of(drawing, camera).likelihood(np.zeros((1, 6)))[0])
        return outline_iou(volume, camera, drawing) + 0.25 * expected_iou(volume) + 0.01 * lines

    ranked = [alone(name) for name in guess_viewpoint(model, drawing)]
    assert len(ranked) == len(sk.QUARTER_VIEWS)
    np.testing.assert_allclose(ranked, sorted(ranked, reverse=True), atol=0.01)
