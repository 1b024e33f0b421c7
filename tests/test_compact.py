"""The compact network: what it listens to, its size, its symmetries, and that it learns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore import _core
from sketchcore.datagen import generate
from sketchcore.nets.cells import Cells, flip, whole
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.decoder import fold, unfold
from sketchcore.nets.loading import passes_of
from sketchcore.nets.outlines import heed_outlines
from sketchcore.nets.passes import Reading
from sketchcore.nets.pieces import join_pieces
from sketchcore.nets.sketches import Sketches, mirror_cameras
from sketchcore.train.chains import Chain, compact_inputs
from sketchcore.train.loss import distance_loss, occupancy_loss
from sketchcore.train.truth import WORLD_TRUTHS

TINY = CompactConfig(stem=8, image=(16, 16, 16), features=8, fused=8, world=(8, 16, 16), groups=2)
CPU = torch.device("cpu")


def chains(counts: tuple[int, ...] = (1, 2), depth: int = 1) -> list[Chain]:
    batch = generate(1, len(counts), views=max(counts))
    made = []
    for i, count in enumerate(counts):
        sketches = Sketches(batch.drawings[i, :count], np.ascontiguousarray(batch.packed_cameras[i, :count]))
        half = np.ascontiguousarray(batch.world[i, :, :, 32:], np.float32)
        made.append(Chain(sketches, half, 1, depth, half * (depth > 0)))
    return made


def inputs(counts: tuple[int, ...] = (1, 2)) -> dict[str, Any]:
    return compact_inputs(chains(counts), CPU)


def awake(net: CompactNet) -> CompactNet:
    """Without the zeros that a new network starts from, so that every path matters."""
    torch.manual_seed(0)
    for parameter in net.parameters():
        if parameter.abs().max() == 0:
            torch.nn.init.normal_(parameter, std=0.1)
    return net.eval()


def tiny_model() -> CompactModel:
    return CompactModel(passes_of(awake(CompactNet(TINY)), CPU))


def test_the_shipped_size_is_within_its_bound() -> None:
    with torch.device("meta"):
        count = sum(p.numel() for p in CompactNet().parameters())
    assert 8e6 < count <= 12e6


def test_the_output_is_half_a_world_grid() -> None:
    with torch.inference_mode():
        logits = CompactNet(TINY)(**inputs())
    assert logits.shape == (2, 64, 64, 32)
    assert torch.isfinite(logits).all()


@pytest.mark.parametrize("name", ["drawings", "fields", "evidence", "prior", "has_prior"])
def test_every_input_matters(name: str) -> None:
    made = inputs()
    net = awake(CompactNet(TINY))
    with torch.inference_mode():
        before = net(**made)
        after = net(**{**made, name: made[name] + 0.3})
    assert ((before - after).abs().amax(dim=(1, 2, 3)) > 1e-4).all()


def test_the_cameras_rotation_and_place_matter() -> None:
    made = inputs((1, 1))
    net = awake(CompactNet(TINY))
    turned = np.stack([sk.Camera.orbit(200.0, 10.0).packed] * 2)
    moved = made["cameras"] + np.array([0.05, 0, 0, *[0] * 12])
    with torch.inference_mode():
        before = net(**made)
        for cameras in (turned, moved):
            assert (before - net(**{**made, "cameras": cameras})).abs().max() > 1e-4


def test_samples_of_a_batch_do_not_mix() -> None:
    net = awake(CompactNet(TINY))
    together = chains((1, 2))
    with torch.inference_mode():
        both = net(**compact_inputs(together, CPU))
        alone = net(**compact_inputs(together[1:], CPU))
    torch.testing.assert_close(both[1:], alone, atol=1e-4, rtol=1e-4)


def test_the_order_of_the_drawings_does_not_matter() -> None:
    net = awake(CompactNet(TINY))
    [chain] = chains((3,))
    s = chain.sketches
    turned = Chain(Sketches(s.drawings[::-1].copy(), s.cameras[::-1].copy()), chain.truth, 1, 1, chain.prior)
    with torch.inference_mode():
        one, other = (net(**compact_inputs([c], CPU)) for c in (chain, turned))
    torch.testing.assert_close(one, other, atol=1e-4, rtol=1e-4)


def test_cells_fold_and_unfold() -> None:
    volume = torch.rand(2, 4, 6, 8)
    cells = fold(volume[:, None])
    assert cells.shape == (2, 2, 3, 4, 8)
    torch.testing.assert_close(unfold(cells.permute(0, 4, 1, 2, 3)), volume)
    corner = cells[0, 1, 2, 3].view(2, 2, 2)
    torch.testing.assert_close(corner, volume[0, 2:4, 4:6, 6:8])


def test_the_mirrored_camera_sees_the_flipped_picture() -> None:
    def shape(x: int, z: int) -> sk.Shape:
        cuboid = sk.Cuboid((0.1 * x, -0.1, 0.15 * z), (0.2, 0.3, 0.1))
        return sk.Shape([cuboid, sk.Cylinder((0, 0.2, -0.2 * z), (0.1, 0.2, 0.1))])

    for name in ("quarter-037", "quarter-322", "front", "top"):
        camera = sk.VIEWPOINTS[name]
        flipped = sk.buffers(shape(1, 1), camera)[0][:, ::-1]
        for axis, image in ((2, shape(1, -1)), (0, shape(-1, 1))):
            mirrored = sk.Camera.from_packed(mirror_cameras(camera.packed[None], axis)[0])
            np.testing.assert_allclose(sk.buffers(image, mirrored)[0], flipped, rtol=1e-6)


def test_a_mirrored_look_has_the_same_evidence() -> None:
    shape = sk.Shape([sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.25)), sk.Cuboid((0.2, 0.2, 0), (0.1, 0.2, 0.1))])
    cameras = [sk.VIEWPOINTS[name] for name in ("quarter-052", "right")]
    sketches = Sketches(np.stack([sk.draw(shape, c) for c in cameras]), np.stack([c.packed for c in cameras]))
    about_z, along_x = (sketches.mirrored(axis).evidence.astype(int) for axis in (2, 0))  # made anew
    plain = sketches.evidence.astype(int)
    assert (np.abs(plain - about_z) > 1).mean() < 0.01
    assert (np.abs(plain[:, ::-1] - along_x) > 1).mean() < 0.01
    assert (np.abs(plain - along_x) > 1).mean() > 0.05, "this shape is not symmetric along x"


def test_rounds_take_turns_and_average() -> None:
    model = tiny_model()
    sketches = chains((2,))[0].sketches
    looks = []
    read = model.passes.read

    def seen(samples: Sequence[Sketches]) -> list[Reading]:
        looks.append(samples[0].cameras)
        return read(samples)

    model.passes.read = seen  # type: ignore[method-assign]
    volumes = list(model.rounds(sketches, 5))
    assert len(volumes) == 6
    cameras = sketches.cameras
    along_x = mirror_cameras(cameras, 0)
    mirrors = [cameras, along_x, mirror_cameras(along_x, 2), mirror_cameras(cameras, 2)]
    np.testing.assert_array_equal(looks, mirrors, "each of the four is read once")
    for volume in volumes:
        assert volume.shape == (64, 64, 64)
        assert volume.dtype == np.float32
        np.testing.assert_array_equal(volume, volume[:, :, ::-1])


def test_a_look_along_x_answers_in_the_world_as_it_is() -> None:
    model = tiny_model()
    sketches = chains((2,))[0].sketches
    # To the network, the second round is a mirrored world: it reads and knows what it would of that one.
    calls = []
    decide = model.passes.decide

    def heard(readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        calls.append((readings, prior, decide(readings, prior, counts)))
        return calls[-1][2]

    model.passes.decide = heard  # type: ignore[method-assign]
    _, second = model.rounds(sketches, 1)
    (_, _, first_answer), (readings, prior, answer) = calls
    assert prior is not None
    np.testing.assert_array_equal(readings[0], model.passes.read([sketches.mirrored(0)])[0])
    np.testing.assert_array_equal(prior[0], flip(first_answer[0]))
    mean = whole((first_answer[0] + flip(answer[0])) / 2)
    np.testing.assert_allclose(second, join_pieces(heed_outlines(mean, sketches)), atol=1e-6)


def test_both_directions_along_x_weigh_the_same() -> None:
    model = tiny_model()
    sketches = chains((1,))[0].sketches
    said = iter([0.1, 0.2, 0.4, 0.5, 0.6])
    model.passes.decide = lambda *_: np.full((1, 32, 32, 16, 8), next(said), np.float32)  # type: ignore[method-assign]
    means = [0.1, (0.1 + 0.2) / 2, (0.1 + 0.3) / 2, (0.3 + 0.3) / 2, ((0.1 + 0.5 + 0.6) / 3 + 0.3) / 2]
    for mean, volume in zip(means, model.rounds(sketches, 4), strict=True):
        expected = heed_outlines(np.full((64, 64, 64), mean, np.float32), sketches)
        np.testing.assert_allclose(volume, join_pieces(expected), rtol=1e-5)


def test_a_volume_known_before_is_one_prediction_among_others() -> None:
    model = tiny_model()
    sketches = chains((1,))[0].sketches
    start = np.zeros((64, 64, 64), np.float32)
    start[:, :, :32] = 1.0
    model.passes.decide = lambda *_: np.full((1, 32, 32, 16, 8), 0.2, np.float32)  # type: ignore[method-assign]
    for number, volume in enumerate(model.rounds(sketches, 3, start)):
        mean = np.full((64, 64, 64), (0.5 + (number + 1) * 0.2) / (number + 2), np.float32)
        np.testing.assert_allclose(volume, join_pieces(heed_outlines(mean, sketches)), rtol=1e-5)


@pytest.mark.parametrize("fractional", [False, True])
def test_loss_against_numpy(fractional: bool) -> None:
    random = np.random.default_rng(0)
    logits = random.normal(size=(2, 64, 64, 32))
    share = random.random((2, 64, 64, 32))
    truth = share if fractional else (share > 0.9).astype(float)

    def log_loss(x: np.ndarray, t: np.ndarray) -> float:
        p = 1 / (1 + np.exp(-x))
        return float(-(t * np.log(p) + (1 - t) * np.log(1 - p)).mean())

    p = 1 / (1 + np.exp(-logits))
    if fractional:
        both, either = np.minimum(p, truth).sum((1, 2, 3)), np.maximum(p, truth).sum((1, 2, 3))
    else:
        both, either = (p * truth).sum((1, 2, 3)), (p + truth - p * truth).sum((1, 2, 3))
    outline = np.mean([log_loss(logits.max(axis), truth.max(axis)) for axis in (1, 2, 3)])
    expected = 10 * log_loss(logits, truth) + 2 * outline + (1 - (both + 1) / (either + 1)).mean()
    got = occupancy_loss(torch.tensor(logits), torch.tensor(truth).float())
    assert float(got) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("kind", ["binary", "fractional", "distance"])
def test_a_tiny_network_learns_two_shapes(kind: str) -> None:
    torch.manual_seed(0)
    batch, samples = chains((1, 2), depth=0), generate(1, 2)
    made = compact_inputs(batch, CPU)
    truth = torch.from_numpy(np.stack([WORLD_TRUTHS[kind](samples, i) for i in range(2)]))
    net = CompactNet(TINY)
    optimizer = torch.optim.Adam(net.parameters(), lr=5e-3)
    losses = []
    loss_of = distance_loss if kind == "distance" else occupancy_loss
    for _ in range(25):
        loss = loss_of(net(**made), truth)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.5 * losses[0]


def test_gradients_reach_every_weight() -> None:
    net = awake(CompactNet(TINY)).train()
    occupancy_loss(net(**inputs()), torch.zeros(2, 64, 64, 32)).backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())


def test_the_kernel_and_the_devices_own_gather_agree() -> None:
    from sketchcore.nets.lift import lift, lift_by_taps

    cameras = np.stack([sk.VIEWPOINTS[name].packed for name in ("quarter-037", "top")])
    features = torch.rand(2, 64 * 64 * 16, 4, requires_grad=True)
    rows, weights = (torch.from_numpy(taps) for taps in _core.lift_taps(cameras))
    ours, theirs = lift(features, cameras), lift_by_taps(features, rows, weights)
    torch.testing.assert_close(ours, theirs)
    towards = torch.rand_like(ours)
    [one] = torch.autograd.grad((ours * towards).sum(), features)
    [other] = torch.autograd.grad((theirs * towards).sum(), features)
    torch.testing.assert_close(one, other, atol=1e-5, rtol=1e-4)
