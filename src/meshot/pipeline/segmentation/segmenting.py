"""White-matter probabilities from a standard scan, and initial surfaces from these probabilities."""

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh
from meshot.model import SegmentationNetwork
from meshot.pipeline.segmentation.surface import SegmentedSurface, segmented_surface
from meshot.volume import StandardScan, Volume


@torch.no_grad()
def segment(scan: Volume, network: SegmentationNetwork) -> dict[Hemisphere, Volume]:
    """The probability of white matter of each side, on the grid of the scan.

    Parameters
    ----------
    scan : Volume
        On the standard grid (or the coarser grid on which the network was trained), in [0, 1].
    network : SegmentationNetwork

    Raises
    ------
    ValueError
        If values are outside [0, 1], or the grid does not suit the network.
    """
    low, high = float(scan.data.min()), float(scan.data.max())
    if low < 0 or high > 1 or low == high:
        raise ValueError(
            f"the scan ranges from {low:.4g} to {high:.4g}; the network knows scans scaled to [0, 1]: bring it to the "
            "standard grid with standard_scan"
        )
    parameter = next(network.parameters())
    image = torch.as_tensor(scan.data.astype(np.float32), device=parameter.device)[None, None]
    probability = torch.softmax(network(image), dim=1)[0, 1:].cpu().numpy()
    return {side: scan.with_data(part) for side, part in zip(HEMISPHERES, probability, strict=True)}


def white_matter(scan: StandardScan, network: SegmentationNetwork) -> dict[Hemisphere, Volume]:
    """The probability of white matter of each side, after a check that some was found on both sides.

    Raises
    ------
    ValueError
        As :func:`meshot.pipeline.segmentation.segment`, or if the network finds no white matter on a side.
    """
    found = segment(scan.volume, network)
    for side, probability in found.items():
        if not (probability.data > 0.5).any():
            raise ValueError(
                f"the network finds no white matter on the {side}: is the scan a T1, upright, and is the network "
                "trained?"
            )
    return found


def initial_surfaces(scan: StandardScan, network: SegmentationNetwork) -> dict[Hemisphere, SegmentedSurface]:
    """The initial white surfaces of both hemispheres in the standard space, with intermediate results.

    Raises
    ------
    ValueError
        As :func:`meshot.pipeline.segmentation.segmenting.white_matter`.
    """
    found = white_matter(scan, network)
    return {side: segmented_surface(probability) for side, probability in found.items()}


def in_scanner(mesh: Mesh, scan: StandardScan) -> Mesh:
    """A mesh of the standard space in scanner RAS of the original scan, in mm, with outward normals."""
    moved = mesh.with_vertices(scan.to_scanner(mesh.vertices))
    return moved if np.linalg.det(scan.to_standard) > 0 else Mesh(moved.vertices, moved.faces.flip(1))
