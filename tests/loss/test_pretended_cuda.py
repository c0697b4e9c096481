"""Losses between meshes on a pretended CUDA device: those of the same meshes on the processor."""

import numpy as np
import pytest
import torch

from meshot.loss import surface_loss
from meshot.mesh.shapes import icosphere
from pretended_cuda import pretended_cuda

LOSSES = {
    "windows": {"loss": "windowed", "window": 4.0, "n_windows": 5, "n_directions": 4, "normal_scale": 2.0, "p": 1},
    "neighbours": {"loss": "chamfer", "encoding": "samples"},
    "partial": {"loss": "sliced_partial", "n_directions": 4, "normal_scale": 2.0},
}


@pytest.mark.parametrize("name", LOSSES)
def test_a_loss_that_the_processor_computes_has_its_value_on_the_device(name):
    loss, meshes = surface_loss(LOSSES[name]), (icosphere(2, 10.0), icosphere(2, 11.0))
    expected = loss(*meshes, np.random.default_rng(3))
    with torch.no_grad(), pretended_cuda():
        found = loss(*(mesh.to("cuda") for mesh in meshes), np.random.default_rng(3))
        assert found.device.type == "cuda"
        assert float(found) == pytest.approx(float(expected), rel=1e-6)
