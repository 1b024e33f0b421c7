"""The project's own convolutions against torch's, forwards and backwards."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore import _core
from sketchcore.nets import convolution, precision
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.convolution import Conv2d, Conv3d
from sketchcore.nets.precision import place
from sketchcore.train.chains import compact_inputs, start_chain
from sketchcore.train.loss import occupancy_loss
from sketchcore.train.presets import PRESETS

TINY: dict[str, Any] = {"stem": 8, "image": (8, 8, 16), "features": 8, "fused": 8, "world": (8, 8, 8), "groups": 4}
CPU = torch.device("cpu")


@pytest.fixture(autouse=True)
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even where torch is faster."""
    monkeypatch.setattr(convolution, "has_own_convolutions", lambda device: device.type == "cpu")


def direct(x: Tensor, weight: Tensor, bias: Tensor | None, rectify: bool) -> Tensor:
    convolve = F.conv2d if weight.dim() == 4 else F.conv3d
    return convolve(F.relu(x) if rectify else x, weight, bias, padding=1)


def layer(inputs: int, outputs: int, axes: int, bias: bool = True) -> Conv2d | Conv3d:
    return (Conv2d if axes == 2 else Conv3d)(inputs, outputs, 3, padding=1, bias=bias)


def close(got: Tensor | None, expected: Tensor | None) -> None:
    assert got is not None
    assert expected is not None
    assert got.shape == expected.shape
    scale = float(expected.detach().double().pow(2).mean().sqrt())
    assert float((got.detach().double() - expected.detach()).abs().max()) <= 1e-4 * scale


@pytest.mark.parametrize("rectify", [False, True])
@pytest.mark.parametrize(
    ("inputs", "outputs", "size"),
    [
        (48, 64, (34, 33)),
        (96, 96, (32, 32)),
        (256, 256, (8, 8)),
        (1, 5, (1, 7)),
        (32, 32, (16, 16, 8)),
        (96, 96, (7, 6, 5)),
        (192, 192, (8, 8, 4)),
        (32, 8, (9, 5, 1)),
        (3, 2, (1, 1, 2)),
    ],
)
def test_results_and_gradients_are_those_of_torch(
    inputs: int, outputs: int, size: tuple[int, ...], rectify: bool
) -> None:
    torch.manual_seed(1)
    own = place(layer(inputs, outputs, len(size)), CPU)
    layout = torch.channels_last if len(size) == 2 else torch.channels_last_3d
    x = torch.randn(3, inputs, *size).contiguous(memory_format=layout).requires_grad_()
    gradient = torch.randn(3, outputs, *size)
    out = own.rectified(x) if rectify else own(x)
    assert out.is_contiguous(memory_format=layout)
    got = torch.autograd.grad(out, [x, own.weight, own.bias], gradient)
    doubles = [t.detach().double().requires_grad_() for t in (x, own.weight, own.bias)]
    expected = direct(*doubles, rectify)
    close(out, expected)
    for g, e in zip(got, torch.autograd.grad(expected, doubles, gradient.double()), strict=True):
        close(g, e)


@pytest.mark.parametrize("axes", [2, 3])
def test_gradients_are_finite_differences(axes: int) -> None:
    torch.manual_seed(2)
    own, x = layer(2, 3, axes), torch.randn(2, 2, *(3, 4, 2)[:axes])
    factor = torch.randn(2, 3, *x.shape[2:])
    parameters = [x.requires_grad_(), own.weight, own.bias]
    gradients = torch.autograd.grad((own(x) * factor).sum(), parameters)
    for parameter, gradient in zip(parameters, gradients, strict=True):
        for at in (0, parameter.numel() // 2, parameter.numel() - 1):
            sums = []
            for step in (0.5, -0.5):
                with torch.no_grad():
                    flat = parameter.view(-1)
                    flat[at] += step
                    sums.append(float((own(x) * factor).double().sum()))
                    flat[at] -= step
            # It is linear in each, so that the step may be large.
            assert float(gradient.flatten()[at]) == pytest.approx(sums[0] - sums[1], abs=1e-3)


@pytest.mark.parametrize("wanted", [(True, False, False), (False, True, False), (False, False, True)])
def test_gradients_that_nobody_wants_are_not_made(
    wanted: tuple[bool, bool, bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    own, x = layer(4, 4, 2), torch.randn(2, 4, 5, 5)
    tensors = [x, own.weight, own.bias]
    for tensor, is_wanted in zip(tensors, wanted, strict=True):
        tensor.requires_grad_(is_wanted)
    for name, needed in zip(("convolve_transposed", "filter_gradient"), wanted, strict=False):
        if not needed:
            monkeypatch.setattr(_core, name, None)
    own(x).sum().backward()
    assert tuple(t.grad is not None for t in tensors) == wanted


def test_without_gradients() -> None:
    own, x = layer(4, 6, 3, bias=False), torch.randn(2, 4, 5, 4, 3)
    expected = direct(x, own.weight, None, True)
    close(own.rectified(x), expected)
    for mode in (torch.no_grad, torch.inference_mode):
        with mode():
            close(own.rectified(x), expected)


def test_layers_are_torchs_own() -> None:
    for mine, theirs in ((Conv2d, nn.Conv2d), (Conv3d, nn.Conv3d)):
        states = []
        for made in (mine, theirs):
            torch.manual_seed(3)
            states.append(made(4, 6, 3, padding=1).state_dict())
        assert list(states[0]) == list(states[1])
        assert all(torch.equal(a, b) for a, b in zip(states[0].values(), states[1].values(), strict=True))


def test_what_kernels_are_not_made_for_is_torchs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "convolve", None)
    x = torch.randn(1, 4, 6, 6)
    assert Conv2d(4, 4, 3, stride=2, padding=1)(x).shape == (1, 4, 3, 3)
    assert Conv2d(4, 4, 1)(x).shape == x.shape
    assert Conv2d(4, 4, 3, padding=1).double()(x.double()).dtype == torch.float64
    with torch.autocast("cpu", torch.bfloat16):
        assert Conv2d(4, 4, 3, padding=1)(x).dtype == torch.bfloat16


def test_processors_with_units_for_matrices_keep_torchs(monkeypatch: pytest.MonkeyPatch) -> None:
    for has in (True, False):
        monkeypatch.setattr(torch.cpu, "_is_amx_tile_supported", lambda has=has: has)
        assert precision.has_own_convolutions(CPU) is not has
    assert not precision.has_own_convolutions(torch.device("cuda"))


def test_a_network_is_trained_as_by_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    chains = [start_chain(PRESETS["compact"], 1, index) for index in range(2)]
    truth = torch.from_numpy(np.stack([chain.truth for chain in chains]))
    losses = []
    for is_own in (True, False):
        monkeypatch.setattr(convolution, "has_own_convolutions", lambda device, is_own=is_own: is_own)
        torch.manual_seed(4)
        net = place(CompactNet(CompactConfig(**TINY)), CPU).train()
        optimizer, losses_so = torch.optim.SGD(net.parameters(), lr=0.05), []
        for _ in range(3):
            optimizer.zero_grad()
            loss = occupancy_loss(net(**compact_inputs(chains, CPU)), truth)
            loss.backward()
            optimizer.step()
            losses_so.append(loss.item())
        losses.append(losses_so)
    assert losses[0] == pytest.approx(losses[1], rel=1e-4)
    assert losses[0][2] < losses[0][0]


@pytest.mark.parametrize(
    ("input", "weight", "bias", "message"),
    [
        ((2, 4, 4), (3, 4, 3, 3), None, "input must have shape .* got .2, 4, 4."),
        ((2, 0, 4, 4), (3, 4, 3, 3), None, "input must have shape"),
        ((2, 4, 4, 4), (3, 5, 3, 3), None, "weight must have shape .n, 4, 3, 3., got .3, 5, 3, 3."),
        ((2, 4, 4, 4), (3, 4, 3, 3, 3), None, "weight must have shape"),
        ((2, 4, 4, 4), (0, 4, 3, 3), None, "weight must have shape at least one channel"),
        ((2, 4, 4, 4), (3, 4, 3, 3), (4,), "bias must have shape .3., got .4."),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    input: tuple[int, ...], weight: tuple[int, ...], bias: tuple[int, ...] | None, message: str
) -> None:
    arrays = [None if shape is None else np.zeros(shape, np.float32) for shape in (input, weight, bias)]
    with pytest.raises(ValueError, match=message):
        _core.convolve(*arrays)  # type: ignore[arg-type]


def test_gradients_that_do_not_fit_are_refused() -> None:
    x, weight = np.zeros((2, 4, 4, 3), np.float32), np.zeros((5, 3, 3, 3), np.float32)
    with pytest.raises(ValueError, match=r"weight must have shape .3, n, 3, 3., got .5, 3, 3, 3."):
        _core.convolve_transposed(x, weight)
    gradient = np.zeros((2, 4, 4, 5), np.float32)
    with pytest.raises(ValueError, match=r"rectified must have shape .2, 4, 4, 3., got .2, 4, 4, 5."):
        _core.convolve_transposed(gradient, weight, rectified=gradient)
    with pytest.raises(ValueError, match="gradient must have shape one for each of the 2 others, got 1"):
        _core.filter_gradient(x, gradient[:1])
    with pytest.raises(ValueError, match=r"gradient must have shape .2, 4, 4, 5., got .2, 4, 3, 5."):
        _core.filter_gradient(x, np.ascontiguousarray(gradient[:, :, :3]))
    with pytest.raises(ValueError, match="input must be C-contiguous"):
        _core.filter_gradient(x.transpose(0, 2, 1, 3), gradient)


def test_an_empty_batch_has_no_gradient() -> None:
    x, weight = np.zeros((0, 4, 4, 3), np.float32), np.ones((5, 3, 3, 3), np.float32)
    assert _core.convolve(x, weight).shape == (0, 4, 4, 5)
    gradient = np.zeros((0, 4, 4, 5), np.float32)
    assert _core.convolve_transposed(gradient, weight).shape == x.shape
    assert not _core.filter_gradient(x, gradient).any()
