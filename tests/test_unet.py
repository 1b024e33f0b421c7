"""The paper's U-Net: its layers, its counts, its skips, its prior and its loss."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from sketchcore.nets.unet import PaperNet, paper_loss

NARROW = 4

SHAPES = {
    "encoder.conv1": (64, 128, 128),
    "encoder.conv2": (128, 64, 64),
    "encoder.conv3": (256, 32, 32),
    "encoder.conv4": (512, 16, 16),
    "encoder.conv5": (512, 8, 8),
    "encoder.conv6": (512, 4, 4),
    "encoder.conv7": (512, 2, 2),
    "encoder.conv8": (512, 1, 1),
    "decoder.deconv1": (512, 2, 2),
    "decoder.deconv2": (512, 4, 4),
    "decoder.deconv3": (512, 8, 8),
    "decoder.deconv4": (512, 16, 16),
    "decoder.deconv5": (256, 32, 32),
    "decoder.deconv6": (128, 64, 64),
}


def meta_net(updater: bool) -> PaperNet:
    """Build the network at full width without its numbers: enough to ask for shapes and counts."""
    with torch.device("meta"):
        return PaperNet(updater)


def narrow_net(updater: bool = False) -> PaperNet:
    torch.manual_seed(7)
    return PaperNet(updater, width=NARROW)


def random_batch(batch: int = 2) -> tuple[Tensor, Tensor]:
    """Draw a drawing [B, 1, 256, 256] and a volume [B, 64, 64, 64] at random."""
    generator = torch.Generator().manual_seed(11)
    drawing = (torch.rand(batch, 1, 256, 256, generator=generator) > 0.9).float()
    return drawing, torch.rand(batch, 64, 64, 64, generator=generator)


def pinned(values: dict[str, Tensor], net: PaperNet, *args: Tensor) -> Tensor:
    """Run the network with the named layers putting out these values, whatever they are given."""

    def put_out(value: Tensor) -> Callable[..., Tensor]:
        return lambda module, inputs, output: value

    hooks = [net.get_submodule(name).register_forward_hook(put_out(value)) for name, value in values.items()]
    try:
        with torch.no_grad():
            output: Tensor = net(*args)
    finally:
        for hook in hooks:
            hook.remove()
    return output


def layer_outputs(net: PaperNet, *args: Tensor) -> dict[str, Tensor]:
    outputs: dict[str, Tensor] = {}

    def keep(name: str) -> Callable[..., None]:
        return lambda module, inputs, output: outputs.update({name: output})

    hooks = [net.get_submodule(name).register_forward_hook(keep(name)) for name in SHAPES]
    with torch.no_grad():
        net(*args)
    for hook in hooks:
        hook.remove()
    return outputs


@pytest.mark.parametrize("updater", [False, True])
def test_every_layer_has_the_papers_shape(updater: bool) -> None:
    args = [torch.empty(2, 1, 256, 256, device="meta")]
    if updater:
        args.append(torch.empty(2, 64, 64, 64, device="meta"))
    net = meta_net(updater)
    shapes = {name: tuple(output.shape) for name, output in layer_outputs(net, *args).items()}
    assert shapes == {name: (2, *shape) for name, shape in SHAPES.items()}
    assert [name for name in SHAPES if name.startswith("encoder")] == [f"encoder.{n}" for n in net.encoder]
    assert [name for name in SHAPES if name.startswith("decoder")] == [f"decoder.{n}" for n in net.decoder]
    assert net(*args).shape == (2, 2, 64, 64, 64)


def test_layers_are_made_of_the_papers_parts() -> None:
    net = meta_net(updater=False)
    parts = {name: [type(part).__name__ for part in net.get_submodule(name).children()] for name in SHAPES}
    expected = {f"encoder.conv{i}": ["Conv2d", "BatchNorm2d", "LeakyReLU"] for i in range(2, 9)}
    for i in range(1, 6):
        dropout = ["Dropout"] if i <= 3 else []
        expected[f"decoder.deconv{i}"] = ["ConvTranspose2d", "BatchNorm2d", *dropout, "ReLU"]
    expected |= {"encoder.conv1": ["Conv2d", "LeakyReLU"], "decoder.deconv6": []}
    assert parts == expected
    assert isinstance(net.decoder["deconv6"], nn.ConvTranspose2d)
    assert {m.negative_slope for m in net.modules() if isinstance(m, nn.LeakyReLU)} == {0.2}
    assert {m.p for m in net.modules() if isinstance(m, nn.Dropout)} == {0.5}
    convolutions = [m for m in net.modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    assert {(m.kernel_size, m.stride) for m in convolutions} == {((4, 4), (2, 2))}


@pytest.mark.parametrize(("updater", "count"), [(False, 54_133_760), (True, 54_395_904)])
def test_convolution_weights_number_exactly(updater: bool, count: int) -> None:
    convolutions = [m for m in meta_net(updater).modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    assert sum(m.weight.numel() for m in convolutions) == count
    # A bias stands only where no batch norm follows: 64 in the first layer and 128 in the last.
    assert sum(m.bias.numel() for m in convolutions if m.bias is not None) == 64 + 128


def test_weights_start_as_in_pix2pix() -> None:
    torch.manual_seed(3)
    net = PaperNet(width=16)
    for module in net.modules():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d) and module.weight.numel() > 10_000:
            assert module.weight.std().item() == pytest.approx(0.02, rel=0.05)
            assert abs(module.weight.mean().item()) < 0.001
        if isinstance(module, nn.BatchNorm2d):
            assert module.weight.mean().item() == pytest.approx(1.0, abs=0.02)
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d | nn.BatchNorm2d) and module.bias is not None:
            assert not module.bias.any()


@pytest.mark.parametrize("layer", range(1, 9))
def test_skips_carry_conv3_to_conv7_past_the_bottleneck(layer: int) -> None:
    net = narrow_net().eval()
    drawing, _ = random_batch(1)
    outputs = layer_outputs(net, drawing)
    encoded = {name: output for name, output in outputs.items() if name.startswith("encoder")}
    whole = pinned(encoded, net, drawing)
    # All other encoder layers keep what they put out, so only a way around them can change the result.
    name = f"encoder.conv{layer}"
    without = pinned(encoded | {name: torch.zeros_like(encoded[name])}, net, drawing)
    assert torch.equal(whole, without) == (layer < 3)


def test_skips_join_layers_of_the_same_size() -> None:
    net = narrow_net().eval()
    drawing, _ = random_batch(1)
    outputs = layer_outputs(net, drawing)
    joined: dict[str, Tensor] = {}
    for i in range(2, 7):
        net.decoder[f"deconv{i}"].register_forward_pre_hook(
            lambda module, inputs, i=i: joined.update({f"deconv{i}": inputs[0]})
        )
    with torch.no_grad():
        net(drawing)
    for i in range(2, 7):
        parts = [outputs[f"decoder.deconv{i - 1}"], outputs[f"encoder.conv{9 - i}"]]
        assert torch.equal(joined[f"deconv{i}"], torch.cat(parts, dim=1))


def test_prior_follows_the_second_convolution() -> None:
    net = narrow_net(updater=True).eval()
    drawing, prior = random_batch(1)
    seen: list[Tensor] = []
    net.encoder["conv3"].register_forward_pre_hook(lambda module, inputs: seen.append(inputs[0]))
    with torch.no_grad():
        some, none, flipped = (net(drawing, p) for p in (prior, torch.zeros_like(prior), prior.flip(1)))
    assert torch.equal(seen[0][:, 2 * NARROW :], prior)  # as it is: not thresholded, depth as channels
    assert not torch.equal(some, none)
    assert not torch.equal(some, flipped)


def test_channels_are_read_as_class_then_depth() -> None:
    net = narrow_net().eval()
    drawing, _ = random_batch(1)
    last = layer_outputs(net, drawing)["decoder.deconv6"]
    with torch.no_grad():
        logits = net(drawing)
    assert torch.equal(logits[:, 0], last[:, :64])
    assert torch.equal(logits[:, 1], last[:, 64:])


def test_evaluation_is_deterministic_and_takes_one_drawing_or_many() -> None:
    net = narrow_net().eval()
    drawing, _ = random_batch(2)
    with torch.no_grad():
        both = net(drawing)
        assert torch.equal(both, net(drawing))
        torch.testing.assert_close(net(drawing[1:]), both[1:], atol=1e-5, rtol=1e-4)


def test_probability_is_the_second_class_of_a_softmax() -> None:
    logits = torch.randn(2, 2, 64, 64, 64, generator=torch.Generator().manual_seed(5)) * 10
    occupied = PaperNet.probability(logits)
    empty = PaperNet.probability(logits.flip(1))
    assert occupied.shape == (2, 64, 64, 64)
    torch.testing.assert_close(occupied + empty, torch.ones_like(occupied))
    assert torch.equal(occupied > 0.5, logits[:, 1] > logits[:, 0])


def slow_loss(logits: np.ndarray, truth: np.ndarray) -> float:
    """Average the log loss voxel by voxel, in float64."""
    total = 0.0
    for index in np.ndindex(*truth.shape):
        empty, occupied = (float(logits[index[0], c, *index[1:]]) for c in (0, 1))
        p = np.exp(occupied) / (np.exp(empty) + np.exp(occupied))
        total -= float(truth[index]) * np.log(p) + (1 - float(truth[index])) * np.log(1 - p)
    return total / truth.size


def test_loss_agrees_with_its_slow_twin() -> None:
    rng = np.random.default_rng(2)
    logits = rng.normal(0, 3, (2, 2, 4, 5, 6)).astype(np.float32)
    truth = rng.uniform(0, 1, (2, 4, 5, 6)).astype(np.float32)
    truth[0] = truth[0] > 0.5
    loss = paper_loss(torch.from_numpy(logits), torch.from_numpy(truth))
    assert loss.dtype == torch.float32
    assert loss.item() == pytest.approx(slow_loss(logits, truth), rel=1e-5)


def test_loss_stays_finite_at_certainty_and_least_at_the_truth() -> None:
    truth = torch.tensor([0.0, 0.25, 1.0]).view(1, 3, 1, 1)
    certain = torch.tensor([[500.0, 0.0, -500.0], [-500.0, 0.0, 500.0]]).view(1, 2, 3, 1, 1)
    assert paper_loss(certain, 1 - truth).item() == pytest.approx(2000.0 / 3, rel=1e-2)
    odds = (truth.clamp(1e-6, 1 - 1e-6)).logit()
    logits = torch.stack([torch.zeros_like(odds), odds], dim=1).requires_grad_()
    (gradient,) = torch.autograd.grad(paper_loss(logits, truth), logits)
    assert gradient.abs().max().item() < 1e-5


def test_loss_falls_on_two_samples() -> None:
    net = narrow_net(updater=True)
    drawing, prior = random_batch(2)
    truth = torch.zeros(2, 64, 64, 64)
    truth[0, 20:40, 10:50, 10:30] = 1.0
    truth[1, 10:50, 30:60, 20:60] = 0.5
    optimiser = torch.optim.Adam(net.parameters(), lr=2e-3, betas=(0.5, 0.999))
    losses = []
    for _ in range(8):
        loss = paper_loss(net(drawing, prior), truth)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert all(p.grad is not None and p.grad.isfinite().all() for p in net.parameters())
    assert losses[-1] < 0.8 * losses[0]


def test_wrong_inputs_are_named() -> None:
    drawing, prior = random_batch(2)
    single, updater = narrow_net(), narrow_net(updater=True)
    with pytest.raises(ValueError, match="at least 2"):
        single(drawing[:1])
    with pytest.raises(ValueError, match=r"\[B, 1, 256, 256\].*\[2, 256, 256\]"):
        single(drawing[:, 0])
    with pytest.raises(ValueError, match=r"torch\.uint8"):
        single(drawing.byte())
    with pytest.raises(ValueError, match="takes no prior"):
        single(drawing, prior)
    with pytest.raises(ValueError, match="needs a prior"):
        updater(drawing)
    with pytest.raises(ValueError, match=r"\[2, 64, 64, 64\].*\[1, 64, 64, 64\]"):
        updater(drawing, prior[:1])
    with pytest.raises(ValueError, match=r"torch\.bool"):
        updater(drawing, prior > 0.5)
    with pytest.raises(ValueError, match=r"truth \[B, D, H, W\]"):
        paper_loss(torch.zeros(2, 2, 4, 4, 4), torch.zeros(1, 4, 4, 4))
    with pytest.raises(ValueError, match="width"):
        PaperNet(width=0)
