"""The drawing of the network: every number that is learned stands in one box."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import pytest
import torch

from meshot.model.deformation import DeformationNetwork
from meshot_book.figures.cortex.network import network_boxes, network_figure


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(params=[(8, (16,), 2, 3), (4, (6, 5, 7), 1, 3)])
def network(request):
    return DeformationNetwork(*request.param)


def test_the_boxes_add_up(network):
    boxes = network_boxes(network)
    assert sum(learned for branch in boxes.values() for *_, learned in branch) == network.n_parameters


def test_shapes_are_those_that_leave_a_layer(network):
    boxes = network_boxes(network)
    width = network.config()["width"]
    assert boxes["position"][-1][1] == boxes["image"][-1][1] == str(width)
    assert boxes["joined"][0][1] == str(2 * width)
    points, features = torch.zeros(5, 3).double(), torch.zeros(5, width).double()
    assert boxes["joined"][-1][1] == str(network(points, features).shape[1])


def test_everything_is_written(network):
    (ax,) = network_figure(network).axes
    said = [text.get_text() for text in ax.texts]
    for branch in network_boxes(network).values():
        for what, shape, learned in branch:
            assert {what, f"→ {shape}"} <= set(said)
            assert not learned or f"learns {learned:,}".replace(",", " ") in said
    assert f"learned in all: {network.n_parameters:,}".replace(",", " ") in said
