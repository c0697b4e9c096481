"""Scans where a system knows them: placed by grey values, or by the white matter that the segmentation finds."""

import dataclasses

from meshot.anatomy import Hemisphere, from_mni152, in_mni152, placed_by_white_matter
from meshot.mesh import Mesh
from meshot.model import SegmentationNetwork
from meshot.pipeline.correspondence import CarriedTemplate, carry_template
from meshot.pipeline.segmentation.segmenting import white_matter
from meshot.types import PLACEMENTS, Placement
from meshot.volume import StandardScan, Volume
from meshot.volume.surfaces import largest_component


def placed_white_matter(
    scan: Volume, first: StandardScan, network: SegmentationNetwork, placement: Placement
) -> tuple[StandardScan, dict[Hemisphere, Volume], list[str]]:
    """A registered scan in the place that is needed, the probability of white matter there, and warnings.

    Parameters
    ----------
    scan : Volume
    first : StandardScan
        The scan, registered by its grey values.
    network : SegmentationNetwork
    placement : str
        The one that is needed.

    Raises
    ------
    ValueError
        As :func:`meshot.pipeline.segmentation.segmenting.white_matter`.
    """
    found = white_matter(first, network)
    if placement == PLACEMENTS[0]:
        return first, found, []
    masks = [largest_component(probability.data > 0.5) for probability in found.values()]
    try:
        placed = placed_by_white_matter(scan, first, first.volume.with_data(masks[0] | masks[1]))
    except ValueError as error:
        return first, found, [f"the white matter does not place the scan ({error}): is it a T1 of a whole brain?"]
    return placed, white_matter(placed, network), []


def carried_in_place(mesh: Mesh, side: Hemisphere, placement: Placement) -> CarriedTemplate:
    """:func:`meshot.pipeline.correspondence.carry_template` for a surface of either standard space."""
    if placement == PLACEMENTS[0]:
        return carry_template(mesh, side)
    carried = carry_template(in_mni152(mesh), side)
    return dataclasses.replace(carried, mesh=from_mni152(carried.mesh))
