"""Metrics of meshes on a pretended CUDA device: those of the same meshes on the processor."""

import pytest
import torch

from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface, vertex_distances
from meshot.metrics.evaluation import evaluate
from meshot.systems.learning import mean_distances
from pretended_cuda import pretended_cuda

MESHES = icosphere(2, 10.0), icosphere(2, 11.0)


@pytest.mark.parametrize("moved", [(True, True), (True, False)])
def test_meshes_on_the_device_have_the_same_metrics(moved):
    few = {"n_points": 200, "n_emd_points": 50}
    with torch.no_grad(), pretended_cuda():
        predicted, target = (mesh.to("cuda") if move else mesh for mesh, move in zip(MESHES, moved))
        found = evaluate(predicted, target, **few).as_dict()
        distances = vertex_distances(predicted, target)
        line = mean_distances([(predicted, Surface(target))], 200)  # the validation of Vox2Cortex and CorticalFlow
    assert found == evaluate(*MESHES, **few).as_dict()
    assert distances.tolist() == vertex_distances(*MESHES).tolist()
    assert line == mean_distances([(MESHES[0], Surface(MESHES[1]))], 200)
