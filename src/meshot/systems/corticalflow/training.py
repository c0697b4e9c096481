"""Training of the blocks of CorticalFlow, one after the other. The earlier blocks do not change."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import Hemisphere
from meshot.loss import chamfer
from meshot.loss.regularity import squared_edge_length
from meshot.mesh import Mesh, sample_points
from meshot.mesh.editing import simplified
from meshot.metrics import Surface
from meshot.systems.corticalflow.blocks import FlowBlock, carried_through
from meshot.systems.corticalflow.settings import ChainSettings
from meshot.systems.examples import ExampleSets, Scan
from meshot.systems.learning import example_data, mean_box, mean_distances, scaled_image, train_part
from meshot.systems.parts import Part
from meshot.train import Groups, Progress, chosen_device
from meshot.types import Tensor


def train_block(
    earlier: Sequence[FlowBlock],
    side: Hemisphere,
    examples: ExampleSets,
    settings: Groups,
    folder: Path | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
    white: Sequence[FlowBlock] = (),
) -> Part:
    """Train the block after ``earlier`` ones of its cascade, which stay as they are.

    The cascade leads from the template to the white surface; or, behind the blocks ``white``, from the surface that
    these find to the pial surface. The loss is the squared Chamfer distance between random points of both surfaces plus
    ``edge_weight`` times the mean squared edge length.

    Parameters
    ----------
    earlier : sequence of FlowBlock
    side : str
    examples : ExampleSets
    settings : dict
        Complete: the groups ``network``, ``template`` and ``training``.
    folder, progress, device
        As :meth:`meshot.systems.SurfaceSystem.train`.
    white : sequence of FlowBlock
        The whole cascade of the white surface, which stays as it is, if this block is for the pial surface.

    Raises
    ------
    ValueError, FloatingPointError
        As :func:`meshot.systems.learning.train_part`.
    """
    training, key = ChainSettings(**settings["training"]), (side, "pial" if white else "white")
    device = device or chosen_device()
    box = mean_box([item.targets[side, "white"] for item in examples.training])  # the white cascade begins there
    network = FlowBlock(
        side, len(earlier), **settings["network"], template=settings["template"], box=box, generator=training.seed
    ).to(device)
    carry = _carrying(network, earlier, white, training, device)
    targets = [item.targets[key].to(torch.float32).to(device) for item in examples.training]
    truths = [Surface(item.targets[key]) for item in examples.validation]

    def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
        found = carry(examples.training[index].scan)
        points = (sample_points(mesh, training.n_samples, draws) for mesh in (found, targets[index]))
        return chamfer(*points) + training.edge_weight * squared_edge_length(found)

    def validate() -> dict:
        with torch.no_grad():
            found = [carry(item.scan) for item in examples.validation]
        return mean_distances(zip(found, truths, strict=True), training.n_points)

    made_with = settings | {"data": example_data(examples, [key])}
    return train_part(network, training, examples, loss_of, validate, made_with, folder, progress)


def _carrying(
    network: FlowBlock, earlier: Sequence[FlowBlock], white: Sequence[FlowBlock], training: ChainSettings,
    device: torch.device,
) -> Callable[[Scan], Mesh]:  # fmt: skip
    """The template after all blocks, in a scan. What the earlier blocks do in a scan is computed once."""
    before, frozen = ([block.to(device).requires_grad_(False) for block in each] for each in (white, earlier))
    template = simplified(network.template.mesh(), training.n_faces).to(torch.float32).to(device)
    flow = (training.n_flow_steps, training.method)

    @functools.cache
    def begun(scan: Scan) -> tuple[Tensor, Mesh, Tensor | None]:
        values = scaled_image(scan.image).to(device)
        with torch.no_grad():
            start, _ = carried_through(before, template, scan.image, values, *flow)
            return values, *carried_through(frozen, start, scan.image, values, *flow)

    def carry(scan: Scan) -> Mesh:
        values, mesh, grids = begun(scan)
        return network.carry(mesh, scan.image, values, grids, *flow)[0]

    return carry
