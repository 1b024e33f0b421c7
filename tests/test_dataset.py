"""The torch data set: every sample once, whoever asks."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

import sketchcore as sk


def indices(dataset: torch.utils.data.IterableDataset, **loader: object) -> list[int]:
    return [int(i) for batch in DataLoader(dataset, batch_size=2, **loader) for i in batch["index"]]


def test_samples_are_those_of_generate() -> None:
    [sample] = sk.datasets.Generated(3, count=1, first=5, views=2)
    batch = sk.generate(3, 1, first=5, views=2)
    np.testing.assert_array_equal(sample["drawings"].numpy(), batch.drawings[0])
    np.testing.assert_array_equal(sample["world"].numpy(), batch.world[0])
    np.testing.assert_array_equal(sample["frusta"].numpy(), batch.frusta[0])
    np.testing.assert_array_equal(sample["cameras"].numpy(), batch.packed_cameras[0])


def test_ranks_share_the_samples() -> None:
    parts = [indices(sk.datasets.Generated(0, count=7, first=10, rank=r, ranks=3)) for r in range(3)]
    assert sorted(i for part in parts for i in part) == list(range(10, 17))
    assert parts[1] == [11, 14]


def test_workers_share_the_samples() -> None:
    dataset = sk.datasets.Generated(0, count=5, rank=1, ranks=2)
    got = indices(dataset, num_workers=2, multiprocessing_context="spawn")
    assert sorted(got) == [1, 3]


def test_no_count_has_no_end() -> None:
    stream = iter(sk.datasets.Generated(0))
    assert [int(next(stream)["index"]) for _ in range(3)] == [0, 1, 2]


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="both rank and ranks"):
        sk.datasets.Generated(0, rank=1)
    with pytest.raises(ValueError, match="between 0 and ranks"):
        sk.datasets.Generated(0, rank=2, ranks=2)
    with pytest.raises(ValueError, match="views must lie"):
        sk.datasets.Generated(0, views=0)
    with pytest.raises(ValueError, match="unknown field"):
        sk.datasets.Generated(0, config={"gramar": {}})
