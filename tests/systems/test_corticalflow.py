"""CorticalFlow: blocks see the flows before them, earlier ones stay as they are, and the template comes nearer."""

import pytest
import torch

from meshot.flow.integration import integrate
from meshot.systems import ExampleSets, Scan, get_system
from meshot.systems.corticalflow import FlowBlock, carried_through
from meshot.systems.learning import scaled_image
from phantoms import phantom_subjects

SMALL = {"width": 2, "depth": 2, "template": {"shape": "sphere"}, "box": torch.tensor([[-18.0, -8, -8], [-2, 8, 8]])}


@pytest.fixture(scope="module")
def examples():
    torch.set_num_threads(1)
    return ExampleSets(phantom_subjects(2, ()), phantom_subjects(1, (), 50))


def test_a_block_sees_the_image_and_the_flows_before_it(examples):
    scan = examples.validation[0].scan
    first, second = FlowBlock("left", 0, **SMALL), FlowBlock("left", 1, **SMALL)
    values, mesh = scaled_image(scan.image), first.template.mesh()
    moved, grids = carried_through([first, second], mesh, scan.image, values, 2, "rk4")
    one = first(values)
    two = second(values, one)
    torch.testing.assert_close(grids, torch.cat([one, two], dim=1))
    assert not torch.allclose(second(values, one + 1), two)
    by_hand = integrate(first.velocity(one, scan.image), mesh.vertices, 2, "rk4")
    by_hand = integrate(second.velocity(two, scan.image), by_hand, 2, "rk4")
    torch.testing.assert_close(moved.vertices, by_hand)


def test_a_velocity_is_the_grid_in_its_unit(examples):
    scan = examples.validation[0].scan
    block = FlowBlock("left", 0, **SMALL, velocity_unit=4.0)
    grid = torch.ones(1, 3, 16, 12, 12) * torch.tensor([1.0, 2, 3])[None, :, None, None, None]
    found = block.velocity(grid, scan.image)(torch.zeros(()), torch.rand(5, 3))
    torch.testing.assert_close(found, torch.tensor([4.0, 8, 12]).expand(5, 3))


def test_one_side_alone_is_not_enough_to_reconstruct(examples):
    kind = get_system("corticalflow")
    assert len(kind.parts_of(kind.complete({}))) == 6
    with pytest.raises(ValueError, match=r"corticalflow has no trained left_white_1, .*: train what is missing"):
        kind({}).reconstruct(Scan(examples.validation[0].scan.image))
