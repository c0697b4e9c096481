"""The trained networks that come with the package, or the same from a folder of one's own."""

import dataclasses
import os
from pathlib import Path

from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights

#: Where the package keeps them.
SHIPPED = Path(__file__).parent.parent / "weights"
SEGMENTATION = "segmentation.safetensors"
DEFORMATION = {"left": "deformation_left.safetensors", "right": "deformation_right.safetensors"}


@dataclasses.dataclass(frozen=True, eq=False)
class TrainedNetworks:
    """What a reconstruction needs to have learned.

    Parameters
    ----------
    segmentation : SegmentationNetwork
    deformation : dict or None
        One network for each side, or none, where initial surfaces are all that is wanted.
    records : dict
        By the name of the file: what was trained, on what, and by which code.
    """

    segmentation: SegmentationNetwork
    deformation: dict[str, DeformationNetwork] | None
    records: dict[str, dict]


def weights_path(name: str, folder: str | os.PathLike | None = None) -> Path:
    """Where the weights of that name lie: in the package, or in ``folder``.

    Raises
    ------
    ValueError
        If the file is missing.
    """
    path = Path(SHIPPED if folder is None else folder) / name
    if not path.is_file():
        place = "this installation came without them" if folder is None else f"there is none in {Path(folder)}"
        raise ValueError(
            f"the trained weights {name} are missing: {place}; name a folder that holds them (--weights), train them "
            "(meshot train-segmentation, meshot train), or do without a deformation network (--initial-only)"
        )
    return path


def trained_networks(folder: str | os.PathLike | None = None, with_deformation: bool = True) -> TrainedNetworks:
    """The networks of a reconstruction, ready to use.

    Parameters
    ----------
    folder : path, optional
        With ``segmentation.safetensors``, ``deformation_left.safetensors`` and ``deformation_right.safetensors``; those
        that come with the package if left out.
    with_deformation : bool

    Raises
    ------
    ValueError
        If a file is missing, or holds something else.
    """
    segmentation, record = read_weights(weights_path(SEGMENTATION, folder), SegmentationNetwork)
    records = {SEGMENTATION: record}
    if not with_deformation:
        return TrainedNetworks(segmentation, None, records)
    deformation = {}
    for side, name in DEFORMATION.items():
        deformation[side], records[name] = read_weights(weights_path(name, folder), DeformationNetwork)
    return TrainedNetworks(segmentation, deformation, records)
