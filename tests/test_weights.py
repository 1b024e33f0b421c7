"""Weights on disk: what goes in comes out, and what is broken says so."""

from __future__ import annotations

import json
import os
import pickle
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch import Tensor

from sketchcore.nets.storing import save_weights
from sketchcore.nets.unet import PaperNet
from sketchcore.nets.weights import load_weights

CONFIG = {"network": "paper", "updater": False, "width": 2, "note": "é"}


@pytest.fixture
def state() -> dict[str, Tensor]:
    torch.manual_seed(1)
    return PaperNet(width=2).state_dict()


@pytest.fixture
def saved(tmp_path: Path, state: dict[str, Tensor]) -> Path:
    path = tmp_path / "net-1.0.safetensors"
    save_weights(path, state, CONFIG)
    return path


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float32, None])
def test_weights_come_back_bit_exact_after_rounding(
    tmp_path: Path, state: dict[str, Tensor], dtype: torch.dtype | None
) -> None:
    path = tmp_path / "net.safetensors"
    save_weights(path, state, CONFIG, dtype)
    loaded, config = load_weights(path)
    assert config == CONFIG
    assert set(loaded) == set(state)
    for name, tensor in state.items():
        expected = (tensor.to(dtype).float() if tensor.is_floating_point() else tensor).numpy()
        assert loaded[name].dtype == expected.dtype
        np.testing.assert_array_equal(loaded[name], expected, name)
    tensors = {name: torch.from_numpy(array) for name, array in loaded.items()}
    PaperNet(width=2).load_state_dict(tensors)
    save_weights(tmp_path / "again.safetensors", tensors, config, dtype)
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes()


def test_integer_buffers_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "net.safetensors"
    batches = torch.tensor(2**53 + 1)
    save_weights(path, {"norm.num_batches_tracked": batches}, {})
    (loaded,) = load_weights(path)[0].values()
    assert loaded.dtype == np.int64
    assert loaded == 2**53 + 1


def test_any_layout_sharing_and_gradient_is_stored(tmp_path: Path) -> None:
    path = tmp_path / "net.safetensors"
    weight = torch.nn.Parameter(torch.randn(4, 3, 2, 2).to(memory_format=torch.channels_last))
    save_weights(path, {"a": weight, "tied": weight, "turned": weight.transpose(0, 1)}, {}, None)
    loaded, _ = load_weights(str(path))
    np.testing.assert_array_equal(loaded["a"], weight.detach().numpy())
    np.testing.assert_array_equal(loaded["tied"], weight.detach().numpy())
    np.testing.assert_array_equal(loaded["turned"], weight.transpose(0, 1).detach().numpy())


def test_loaded_weights_are_writable_and_their_own(saved: Path) -> None:
    loaded, _ = load_weights(saved)
    for array in loaded.values():
        array[...] = 0
    assert any(array.any() for array in load_weights(saved)[0].values())


def test_two_readable_files_and_nothing_else_are_left(saved: Path) -> None:
    assert sorted(os.listdir(saved.parent)) == ["net-1.0.json", "net-1.0.safetensors"]
    assert json.loads((saved.parent / "net-1.0.json").read_text("utf-8")) == CONFIG
    plain = saved.parent / "plain"
    plain.touch()
    assert stat.S_IMODE(saved.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_failed_write_keeps_the_old_file(
    saved: Path, state: dict[str, Tensor], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {file.name: file.read_bytes() for file in saved.parent.iterdir()}

    def full_disk(descriptor: int) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        save_weights(saved, {name: t + 1 for name, t in state.items()}, {"other": True})
    assert {file.name: file.read_bytes() for file in saved.parent.iterdir()} == before


@pytest.mark.parametrize("left", [0, 4, 200, -1])
def test_truncated_weights_raise(saved: Path, left: int) -> None:
    saved.write_bytes(saved.read_bytes()[:left])
    with pytest.raises(ValueError, match=r"net-1\.0\.safetensors are truncated, corrupt"):
        load_weights(saved)


def test_pickles_are_refused_and_never_run(saved: Path, tmp_path: Path, state: dict[str, Tensor]) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "sprung"),)

    saved.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(ValueError, match="no safetensors file"):
        load_weights(saved)
    torch.save(state, saved)
    with pytest.raises(ValueError, match="no safetensors file"):
        load_weights(saved)
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 70_000.0])
def test_weights_that_cannot_be_stored_raise(saved: Path, bad: float) -> None:
    before = saved.read_bytes()
    with pytest.raises(ValueError, match=r"torch\.float16 have NaN or infinite entries: conv\.weight"):
        save_weights(saved, {"fine": torch.ones(2), "conv.weight": torch.tensor([1.0, bad])}, CONFIG)
    assert saved.read_bytes() == before


def test_non_finite_weights_on_disk_raise(saved: Path) -> None:
    save_file({name: torch.full((2,), torch.nan) for name in "abcde"}, saved)
    with pytest.raises(ValueError, match="infinite entries: a, b, c and 2 more"):
        load_weights(saved)


@pytest.mark.parametrize("text", [b"{", b"", b"\xff\xfe\xfa", b"[1, 2]", b"null"])
def test_broken_config_raises(saved: Path, text: bytes) -> None:
    saved.with_suffix(".json").write_bytes(text)
    with pytest.raises(ValueError, match=r"net-1\.0\.json (is damaged|is not valid|must be a JSON object)"):
        load_weights(saved)


def test_missing_files_raise(saved: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no weights at"):
        load_weights(saved.with_name("other.safetensors"))
    with pytest.raises(FileNotFoundError, match="no folder"):
        save_weights(saved.parent / "nowhere" / "net.safetensors", {}, {})
    saved.with_suffix(".json").unlink()
    with pytest.raises(FileNotFoundError, match=r"net-1\.0\.json is missing"):
        load_weights(saved)


def test_wrong_arguments_are_named(tmp_path: Path, state: dict[str, Tensor]) -> None:
    for name in ("net.pt", "net", "safetensors"):
        with pytest.raises(ValueError, match=r"stored as \.safetensors"):
            save_weights(tmp_path / name, state, CONFIG)
        with pytest.raises(ValueError, match=r"stored as \.safetensors"):
            load_weights(tmp_path / name)
    with pytest.raises(ValueError, match="floating-point dtype"):
        save_weights(tmp_path / "net.safetensors", state, CONFIG, torch.int8)
    with pytest.raises(TypeError, match="JSON"):
        save_weights(tmp_path / "net.safetensors", state, {"path": tmp_path})
    with pytest.raises(ValueError, match="JSON"):
        save_weights(tmp_path / "net.safetensors", state, {"rate": float("nan")})
    assert not list(tmp_path.iterdir())


def test_a_reconstruction_on_the_cpu_imports_no_torch(tmp_path: Path) -> None:
    code = (
        "import sys, sketchcore as sk; camera = sk.VIEWPOINTS['quarter-037']; "
        "drawing = sk.draw(sk.Shape([sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2))]), camera); "
        "sk.reconstruct(drawing, camera, device='cpu').save(sys.argv[1]); print('torch' in sys.modules)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "box.glb")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_loading_a_network_of_torch_imports_no_compiler(saved: Path) -> None:
    """It takes two seconds to import, and arithmetic on tensors without memory would do so."""
    state = {f"single.{name}": tensor for name, tensor in PaperNet(width=2).state_dict().items()}
    save_weights(saved, state, {"network": "paper", "options": {"width": 2}})
    code = "import sys, sketchcore; sketchcore.load_model(sys.argv[1]); print('torch._dynamo' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, str(saved)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
