"""The compact network: what it listens to, its size, and that it learns."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from sketchcore import _core
from sketchcore.datagen import generate
from sketchcore.nets.compact import CompactConfig, CompactNet, compact_inputs, compact_loss

TINY = CompactConfig(stem=8, widths=(16, 16, 16), blocks=(1, 1, 1), groups=2)
CPU = torch.device("cpu")


def inputs(count: int = 2) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    batch = generate(1, count, views=1)
    cameras = batch.packed_cameras[:, 0]
    fields = _core.evidence_fields(batch.drawings[:, 0])
    evidence = np.stack([_core.evidence(fields[i : i + 1], cameras[i : i + 1], 0, True) for i in range(count)])
    prior = _core.to_camera_grid(batch.world.astype(np.float32), cameras)
    made = compact_inputs(
        batch.drawings[:, 0], fields, evidence, prior, cameras, np.ones(count), np.ones(count, bool), CPU
    )
    return made, torch.from_numpy(batch.frusta[:, 0]).float() / 255


def awake(net: CompactNet) -> CompactNet:
    """Without the zeros that a new network starts from, so that every path matters."""
    torch.manual_seed(0)
    for parameter in net.parameters():
        if parameter.abs().max() == 0:
            torch.nn.init.normal_(parameter, std=0.1)
    return net.eval()


def test_the_shipped_size_is_within_its_bound() -> None:
    with torch.device("meta"):
        count = sum(p.numel() for p in CompactNet().parameters())
    assert 8e6 < count <= 12e6


def test_the_output_is_a_camera_grid_and_a_probability() -> None:
    made, _ = inputs()
    with torch.inference_mode():
        logits = CompactNet(TINY)(**made)
    assert logits.shape == (2, 64, 64, 64)
    assert torch.isfinite(logits).all()


@pytest.mark.parametrize("name", ["drawing", "fields", "evidence", "prior", "rotation", "drawings", "has_prior"])
def test_every_input_matters(name: str) -> None:
    made, _ = inputs()
    net = awake(CompactNet(TINY))
    with torch.inference_mode():
        before = net(**made)
        after = net(**{**made, name: made[name] + 0.3})
    assert (before - after).abs().max() > 1e-4


def test_no_prior_is_a_zero_prior_that_says_so() -> None:
    made, _ = inputs()
    net = awake(CompactNet(TINY))
    absent = {**made, "prior": torch.zeros_like(made["prior"]), "has_prior": torch.zeros(2)}
    with torch.inference_mode():
        implicit = net(**{**made, "prior": None, "has_prior": None})
        torch.testing.assert_close(implicit, net(**absent))


def test_samples_of_a_batch_do_not_mix() -> None:
    made, _ = inputs()
    net = awake(CompactNet(TINY))
    with torch.inference_mode():
        both = net(**made)
        alone = net(**{name: tensor[1:] for name, tensor in made.items()})
    torch.testing.assert_close(both[1:], alone, atol=1e-4, rtol=1e-4)


def test_loss_against_numpy() -> None:
    random = np.random.default_rng(0)
    logits, truth = random.normal(size=(2, 64, 64, 64)), random.random((2, 64, 64, 64))
    p = 1 / (1 + np.exp(-logits))
    log_loss = -(truth * np.log(p) + (1 - truth) * np.log(1 - p)).mean()
    both, either = (p * truth).sum((1, 2, 3)), (p + truth - p * truth).sum((1, 2, 3))
    q, seen = 1 / (1 + np.exp(-logits.max(1))), truth.max(1)
    outline = -(seen * np.log(q) + (1 - seen) * np.log(1 - q)).mean()
    expected = 10 * log_loss + 2 * outline + (1 - (both + 1) / (either + 1)).mean()
    assert float(compact_loss(torch.tensor(logits), torch.tensor(truth).float())) == pytest.approx(expected, rel=1e-4)


def test_a_tiny_network_learns_two_shapes() -> None:
    torch.manual_seed(0)
    made, truth = inputs()
    net = CompactNet(TINY)
    optimizer = torch.optim.Adam(net.parameters(), lr=5e-3)
    losses = []
    for _ in range(25):
        loss = compact_loss(net(**made), truth)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.5 * losses[0]
