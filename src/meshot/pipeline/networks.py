"""The trained networks that come with the package, or the same from a folder of one's own."""

import dataclasses
import os
import reprlib
from pathlib import Path

from meshot.model import N_STEPS, DeformationNetwork, SegmentationNetwork, network_digest, read_weights

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
    n_steps, method : int, str
        How the flows were integrated while they were learned: see :func:`meshot.integrate`.
    """

    segmentation: SegmentationNetwork
    deformation: dict[str, DeformationNetwork] | None
    records: dict[str, dict]
    n_steps: int = N_STEPS
    method: str = "euler"


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


def load_networks(folder: str | os.PathLike | None = None, with_deformation: bool = True) -> TrainedNetworks:
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
        If a file is missing, or holds something else: also the flow of the other side, or one that was learned from
        initial surfaces of another segmentation network; or if the flows of both sides were integrated differently.
    """
    segmentation, record = read_weights(weights_path(SEGMENTATION, folder), SegmentationNetwork)
    records = {SEGMENTATION: record}
    if not with_deformation:
        return TrainedNetworks(segmentation, None, records)
    deformation = {}
    for side, name in DEFORMATION.items():
        deformation[side], records[name] = read_weights(weights_path(name, folder), DeformationNetwork)
        _require_groups(name, records[name])
        _require_fitting(side, name, records[name], network_digest(segmentation))
    n_steps, method = _integration([records[name] for name in DEFORMATION.values()])
    return TrainedNetworks(segmentation, deformation, records, n_steps, method)


def _require_groups(name: str, record: dict) -> None:
    for group in ("training", "results"):
        if not isinstance(record.get(group, {}), dict):
            raise ValueError(f"{name} says of its {group} {reprlib.repr(record[group])}; names and values are needed")


def _require_fitting(side: str, name: str, record: dict, segmentation: str) -> None:
    """What a record says, if it says anything, must fit."""
    trained = record.get("training", {}).get("side", side)
    if trained != side:
        raise ValueError(f"{name} holds the flow of the {trained} side; that of the {side} one is needed: rename it")
    if record.get("results", {}).get("segmentation_sha256", segmentation) != segmentation:
        raise ValueError(
            f"{name} was learned from initial surfaces of another network than {SEGMENTATION}: put the one beside it "
            "that it was trained with, or train it anew (meshot train --segmentation)"
        )


def _integration(records: list[dict]) -> tuple[int, str]:
    usual = {"n_flow_steps": N_STEPS, "method": "euler"}
    found = [usual | {k: v for k, v in record.get("training", {}).items() if k in usual} for record in records]
    if any(each != found[0] for each in found):
        raise ValueError(f"the flows were learned with {found}; both sides need the same: train one of them anew")
    return found[0]["n_flow_steps"], found[0]["method"]
