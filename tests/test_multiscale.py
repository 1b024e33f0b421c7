"""The multi-scale network: its scales, that all of them count, that it learns, and what comes of it in use."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

import sketchcore as sk
from sketchcore.camera import pack_cameras
from sketchcore.nets.loading import build_model
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.singleview import SingleViewModel
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.storing import save_weights
from sketchcore.nets.unet import paper_loss
from sketchcore.nets.weights import load_weights

CPU = torch.device("cpu")
SHAPES = {
    "scale1.convolutions": (256, 8, 8),
    "scale1": (64, 8, 8),
    "image2": (96, 32, 32),
    "scale2": (128, 32, 32),
    "image3": (96, 64, 64),
    "scale3": (128, 64, 64),
}


def narrow_net(width: int = 4) -> MultiscaleNet:
    torch.manual_seed(3)
    return MultiscaleNet(width)


def random_drawings(batch: int = 2) -> Tensor:
    generator = torch.Generator().manual_seed(11)
    return (torch.rand(batch, 1, 256, 256, generator=generator) > 0.9).float()


def layer_outputs(net: MultiscaleNet, drawing: Tensor) -> dict[str, Tensor]:
    outputs: dict[str, Tensor] = {}

    def keep(name: str) -> Callable[..., None]:
        return lambda module, inputs, output: outputs.update({name: output})

    hooks = [net.get_submodule(name).register_forward_hook(keep(name)) for name in SHAPES]
    with torch.no_grad():
        outputs["logits"] = net(drawing)
    for hook in hooks:
        hook.remove()
    return outputs


def test_every_scale_has_its_shape_and_the_size_is_as_documented() -> None:
    with torch.device("meta"):
        net = MultiscaleNet()
    with FlopCounterMode(display=False) as flops:
        outputs = layer_outputs(net, torch.empty(3, 1, 256, 256, device="meta"))
    assert {name: tuple(outputs[name].shape) for name in SHAPES} == {n: (3, *s) for n, s in SHAPES.items()}
    assert outputs["logits"].shape == (3, 2, 64, 64, 64)
    parameters, each = sum(p.numel() for p in net.parameters()), flops.get_total_flops() / 3
    assert f"{parameters / 1e6:.1f} M parameters; {each / 1e9:.1f} GFLOP" in (MultiscaleNet.__doc__ or "")


def test_channels_are_read_as_class_then_depth() -> None:
    outputs = layer_outputs(narrow_net().eval(), random_drawings())
    assert torch.equal(outputs["logits"].flatten(1, 2), outputs["scale3"])


@pytest.mark.parametrize("name", ["scale1", "image2", "scale2", "image3"])
def test_every_scale_counts(name: str) -> None:
    net, drawing = narrow_net().eval(), random_drawings()
    with torch.no_grad():
        before = net(drawing)
        hook = net.get_submodule(name).register_forward_hook(lambda module, inputs, output: output + 1)
        after = net(drawing)
    hook.remove()
    assert not torch.allclose(before, after, atol=1e-4)


def test_the_first_scale_sees_the_whole_drawing_and_the_others_what_is_near() -> None:
    net = narrow_net().eval()
    blank, dotted = torch.zeros(1, 1, 256, 256), torch.zeros(1, 1, 256, 256)
    dotted[..., 4:12, 4:12] = 1.0
    with torch.no_grad():
        moved = {
            name: (net.get_submodule(name)(dotted) != net.get_submodule(name)(blank)).any(dim=1)[0]
            for name in ("scale1", "image2", "image3")
        }
    assert moved["scale1"].float().mean() > 0.3
    assert moved["scale1"][4:, 4:].any()
    for name, cells in (("image2", 3), ("image3", 5)):
        assert moved[name][:cells, :cells].any()
        assert not moved[name][cells:].any()
        assert not moved[name][:, cells:].any()


def test_it_learns_two_drawings_and_every_weight_takes_part() -> None:
    net = narrow_net()
    drawing = random_drawings()
    truth = torch.zeros(2, 64, 64, 64)
    truth[0, 20:40, 10:50, 10:30] = 1.0
    truth[1, 10:50, 30:60, 20:60] = 0.5
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-2)
    losses = []
    for _ in range(8):
        loss = paper_loss(net(drawing), truth)
        optimizer.zero_grad()
        loss.backward()
        assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.6 * losses[0]


def test_only_the_first_drawing_counts_and_rounds_change_nothing() -> None:
    model = SingleViewModel(narrow_net(), CPU)
    batch = sk.generate(2, 1, views=3)
    sketches = Sketches(batch.drawings[0], batch.packed_cameras[0])
    first = Sketches(sketches.drawings[:1], sketches.cameras[:1])
    volumes = list(model.rounds(sketches, 4))
    assert len(volumes) == 5
    for volume in volumes:
        np.testing.assert_array_equal(volume, next(model.first_predictions([first])))
    in_camera = model.predict(sketches.drawings[:1])[0]
    np.testing.assert_array_equal(volumes[0], sk.to_world_grid(in_camera, batch.cameras[0][0]))


def test_what_is_known_stays_where_the_first_camera_does_not_see() -> None:
    model = SingleViewModel(narrow_net(), CPU)
    near = sk.Camera.orbit(37.0, 30.0, 0.9, fov_degrees=30.0)
    sketches = Sketches(np.zeros((1, 256, 256), np.uint8), pack_cameras([near]))
    start = np.full((64, 64, 64), 0.25, np.float32)
    unseen = sk.to_world_grid(np.ones((64, 64, 64)), near) == 0
    assert 0.05 < unseen.mean() < 0.95
    [volume] = model.rounds(sketches, 0, start)
    assert (volume[unseen] == 0.25).all()
    assert (volume[~unseen] != 0.25).mean() > 0.9


def test_several_drawings_are_predicted_as_each_by_itself() -> None:
    model = SingleViewModel(narrow_net(), CPU)
    drawings = sk.generate(2, 3).drawings[:, 0]
    each = np.concatenate([model.predict(drawing[None]) for drawing in drawings])
    np.testing.assert_allclose(model.predict(drawings), each, atol=0.02)


def test_stored_weights_build_the_same_model(tmp_path: Path) -> None:
    net = narrow_net()
    path = tmp_path / "weights.safetensors"
    save_weights(path, net.state_dict(), {"network": "multiscale", "options": net.describe()}, dtype=None)
    model = build_model(*load_weights(path), device="cpu")
    drawing = sk.generate(1, 1).drawings[:, 0]
    assert isinstance(model, SingleViewModel)
    np.testing.assert_array_equal(model.predict(drawing), SingleViewModel(net, CPU).predict(drawing))
    solid = sk.reconstruct(drawing[0], "quarter-037", iterations=2, model=path)
    assert solid.trace == (0.0,), "a round that changes nothing is the last"


def test_wrong_arguments_are_named() -> None:
    for width in (0, 3):
        with pytest.raises(ValueError, match=f"even number of at least 2, got {width}"):
            MultiscaleNet(width)
    with pytest.raises(ValueError, match=r"\[B, 1, 256, 256\].*\[2, 1, 128, 128\]"):
        narrow_net()(torch.zeros(2, 1, 128, 128))
    state = {name: tensor.numpy() for name, tensor in narrow_net().state_dict().items()}
    with pytest.raises(ValueError, match="do not fit"):
        build_model(state, {"network": "multiscale", "options": {"width": 8}})
    with pytest.raises(ValueError, match="another version of the network 'multiscale'"):
        build_model(state, {"network": "multiscale", "options": {"depth": 8}})
    with pytest.raises(ValueError, match="'compact', 'paper' and 'multiscale' are known"):
        build_model(state, {"network": "vgg"})
