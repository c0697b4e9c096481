"""What a reconstruction needs to have learned: the segmentation network and a system, as they come with the package."""

import dataclasses
import os
from pathlib import Path

from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.systems import SHIPPED, SurfaceSystem, load_system

SEGMENTATION = "segmentation.safetensors"


@dataclasses.dataclass(frozen=True, eq=False)
class TrainedNetworks:
    """What a reconstruction needs to have learned.

    Parameters
    ----------
    segmentation : SegmentationNetwork
    system : SurfaceSystem or None
        None where initial surfaces are all that is wanted.
    records : dict
        By the name of the file: what was trained, on what, and by which code.
    """

    segmentation: SegmentationNetwork
    system: SurfaceSystem | None
    records: dict[str, dict]


def segmentation_weights(path: str | os.PathLike | None = None) -> Path:
    """Where the weights of the segmentation network lie: at ``path``, or in the package.

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


def load_networks(
    system: str | None = None,
    weights: str | os.PathLike | None = None,
    segmentation: str | os.PathLike | None = None,
    initial_only: bool = False,
) -> TrainedNetworks:
    """The networks of a reconstruction, ready to use.

    Parameters
    ----------
    system : str, optional
        The name of a system; the default of the package if left out.
    weights : path, optional
        The folder with the parts of the system; those that come with the package if left out.
    segmentation : path, optional
        The weights of the segmentation network; those that come with the package if left out.
    initial_only : bool
        Without a system.

    Raises
    ------
    ValueError
        If a system is unknown, a file is missing or holds something else, or the system has learned from initial
        surfaces of another segmentation network.
    """
    network, record = read_weights(segmentation_weights(segmentation), SegmentationNetwork)
    if initial_only:
        return TrainedNetworks(network, None, {SEGMENTATION: record})
    found = load_system(system, weights)
    records = {f"{name}.safetensors": part.record for name, part in found.parts.items()}
    for name, each in records.items():
        if each.get("results", {}).get("segmentation_sha256", network_digest(network)) != network_digest(network):
            raise ValueError(
                f"{name} was learned from initial surfaces of another network than {SEGMENTATION}: name the one that "
                "it was trained with (--segmentation), or train it anew (meshot train --segmentation)"
            )
    return TrainedNetworks(network, found, {SEGMENTATION: record} | records)
