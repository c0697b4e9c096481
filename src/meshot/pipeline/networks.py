"""The trained networks of a reconstruction: the segmentation network and a system, with the package's weights."""

import dataclasses
import os
from pathlib import Path

from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.systems import SHIPPED, SurfaceSystem, load_system
from meshot.types import PLACEMENTS, Placement

SEGMENTATION = "segmentation.safetensors"


@dataclasses.dataclass(frozen=True, eq=False)
class TrainedNetworks:
    """The trained networks of a reconstruction.

    Parameters
    ----------
    segmentation : SegmentationNetwork
    system : SurfaceSystem or None
        None if only initial surfaces are needed.
    records : dict
        The record of the training of each network, by file name.
    """

    segmentation: SegmentationNetwork
    system: SurfaceSystem | None
    records: dict[str, dict]


def segmentation_weights(path: str | os.PathLike | None = None) -> Path:
    """The path of the weights of the segmentation network: ``path``, or the file in the package.

    Raises
    ------
    ValueError
        If the file is missing.
    """
    found = SHIPPED / SEGMENTATION if path is None else Path(path)
    if not found.is_file():
        place = "this installation came without them" if path is None else f"{found} does not exist"
        raise ValueError(
            f"the weights of the segmentation network are missing: {place}; name their file (--segmentation), or train "
            "them (meshot train-segmentation)"
        )
    return found


def require_placement(segmentation: SegmentationNetwork, placement: Placement, what: str) -> None:
    """Check that a segmentation network can place scans as they are needed.

    A network that learned from scans placed by their white matter knows the other placement, too.

    Raises
    ------
    ValueError
        If the network knows scans by their grey values only, and the other placement is needed.
    """
    if placement != PLACEMENTS[0] and segmentation.placement == PLACEMENTS[0]:
        raise ValueError(
            f"{what} needs scans that are placed by {placement}, and the segmentation network learned from scans that "
            f"are placed by {segmentation.placement}: name another one (--segmentation), or leave it out"
        )


def load_networks(
    system: str | None = None,
    weights: str | os.PathLike | None = None,
    segmentation: str | os.PathLike | None = None,
    initial_only: bool = False,
    device: str | None = None,
) -> TrainedNetworks:
    """Load the networks of a reconstruction.

    Parameters
    ----------
    system : str, optional
        The name of a system. By default that of the package.
    weights : path, optional
        The folder with the parts of the system. By default that of the package.
    segmentation : path, optional
        The weights of the segmentation network. By default those of the package.
    initial_only : bool
        Whether to load no system.
    device : str, optional
        Where the networks compute, such as "cuda". By default the processor. The other stages of a reconstruction use
        the processor.

    Raises
    ------
    ValueError
        If a system is unknown, a file is missing or of another kind, or the system was trained on initial surfaces of
        another segmentation network.
    """
    network, record = read_weights(segmentation_weights(segmentation), SegmentationNetwork)
    if initial_only:
        return TrainedNetworks(network.to(device), None, {SEGMENTATION: record})
    found = load_system(system, weights)
    records = {f"{name}.safetensors": part.record for name, part in found.parts.items()}
    for name, each in records.items():
        if each.get("results", {}).get("segmentation_sha256", network_digest(network)) != network_digest(network):
            raise ValueError(
                f"{name} was learned from initial surfaces of another network than {SEGMENTATION}: name the one that "
                "it was trained with (--segmentation), or train it anew (meshot train --segmentation)"
            )
    require_placement(network, found.placement, found.name)
    for part in found.parts.values():
        part.network.to(device)
    return TrainedNetworks(network.to(device), found, {SEGMENTATION: record} | records)
