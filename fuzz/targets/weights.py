"""Weights with the config beside them, the model that they make, and checkpoints: two files in one input."""

from __future__ import annotations

import json
import pickle
from random import Random

import torch
from safetensors.torch import save

import sketchcore as sk
from harness import SCRATCH, Target
from mutations import dump, of_bytes, of_json, of_safetensors
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.unet import PaperNet
from sketchcore.train.checkpoint import load_checkpoint

torch.set_num_threads(1)
_CAMERA = sk.VIEWPOINTS["quarter-037"]
_SKETCHES = Sketches(sk.draw(sk.Shape([sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2))]), _CAMERA)[None], _CAMERA.packed[None])


def attempt(data: bytes) -> None:
    """Input: kind, the config's size in four bytes, the config, the weights."""
    size = int.from_bytes(data[1:5], "little")
    path = SCRATCH / "net.safetensors"
    path.with_suffix(".json").write_bytes(data[5 : 5 + size])
    path.write_bytes(data[5 + size :])
    if data[:1] == b"k":
        load_checkpoint(path)
        return
    model = sk.load_model(path, "cpu")
    volume = next(iter(model.first_predictions([_SKETCHES])))
    assert volume.shape == (64, 64, 64)


def _input(kind: bytes, config: bytes, weights: bytes) -> bytes:
    return kind + len(config).to_bytes(4, "little") + config + weights


def seeds() -> list[bytes]:
    """Small networks of each kind, a checkpoint, and a pickle."""
    torch.manual_seed(0)
    tiny = CompactConfig(4, (4, 4, 8), 2, 4, (4, 4, 8), 2)
    compact, paper, multiscale = CompactNet(tiny), PaperNet(width=1), MultiscaleNet(width=2)
    nets = [
        ({"network": "compact", "options": compact.describe()}, compact.state_dict()),
        ({"network": "paper", "options": {"width": 1}}, {f"single.{k}": v for k, v in paper.state_dict().items()}),
        ({"network": "multiscale", "options": multiscale.describe()}, multiscale.state_dict()),
    ]
    inputs = [
        _input(b"w", dump(c), save({k: v.half() if v.is_floating_point() else v for k, v in s.items()}))
        for c, s in nets
    ]
    told = {
        "progress": json.dumps(
            {"stage": "one", "step": 3, "samples": 5, "seconds": 1.5, "began": {"network": "compact"}}
        ),
        "task": json.dumps({"seed": "0"}),
    }
    checkpoint = {"model.a": torch.ones(2), "average.a": torch.ones(2), "optimizer.0.1.exp_avg": torch.ones(2)}
    inputs.append(_input(b"k", b"", save(checkpoint, metadata=told)))
    inputs.append(_input(b"w", dump(nets[0][0]), pickle.dumps({"a": [1, 2]})))
    return inputs


def mutate(data: bytes, random: Random) -> bytes:
    """The config as JSON, or the header of the weights."""
    size = int.from_bytes(data[1:5], "little")
    kind, config, weights = data[:1], data[5 : 5 + size], data[5 + size :]
    if random.random() < 0.5:
        try:
            config = dump(of_json(json.loads(config), random))
        except (ValueError, RecursionError):
            config = of_bytes(config, random)
    else:
        weights = of_safetensors(weights, random)
    return _input(kind, config, weights)


TARGET = Target(attempt, seeds, mutate, (ValueError,), megabytes=512)
