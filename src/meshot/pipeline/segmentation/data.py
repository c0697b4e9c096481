"""Training data of the segmentation network: standard scans, and the white-matter fraction of every voxel."""

import dataclasses
import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES
from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.pipeline.splits import scans_of
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume
from meshot.volume.surfaces import enclosed_fractions

_IMAGE_LEVELS, _FRACTION_LEVELS = 65535, 255


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """A scan and its true fractions, quantised to 4 bytes per voxel so that a cohort fits into memory.

    Parameters
    ----------
    name : str
    image : array
        uint16, where 65535 means 1.
    fractions : array
        uint8, for left and right. 255 is a voxel entirely inside the white surface.
    """

    name: str
    image: Array
    fractions: Array

    def tensors(self, soft: bool = True) -> tuple[Float[Tensor, "1 x y z"], Float[Tensor, "2 x y z"]]:
        """Image and fractions as float32. Unless ``soft``, each fraction is rounded to 0 or 1."""
        fractions = torch.from_numpy(self.fractions).float() / _FRACTION_LEVELS
        image = torch.from_numpy(self.image.astype(np.float32) / _IMAGE_LEVELS)
        return image[None], fractions if soft else (fractions > 0.5).float()


def example(name: str, scan: Volume, white: Mapping[str, Mesh], reduction: int = 1) -> Example:
    """Make an example from a standard scan and the true white surfaces in the same space.

    Parameters
    ----------
    name : str
    scan : Volume
        Values in [0, 1].
    white : mapping
        "left" and "right": closed, oriented outwards, in mm, in the space of the scan.
    reduction : int
        Number of voxels along each axis that are averaged into one.

    Raises
    ------
    ValueError
        If values are outside [0, 1], a side is missing, the size of an axis is not a multiple of ``reduction``, or a
        surface lies outside the scan.
    """
    if set(white) != set(HEMISPHERES):
        raise ValueError(f"white holds {sorted(white)}; one surface each for left and right is needed")
    if scan.data.min() < 0 or scan.data.max() > 1:
        raise ValueError(
            f"the scan of {name} ranges from {scan.data.min():.4g} to {scan.data.max():.4g}; values in [0, 1] are "
            "needed: bring it to the standard grid first"
        )
    fractions = np.stack([enclosed_fractions(white[side], scan) for side in HEMISPHERES])
    empty = [side for side, part in zip(HEMISPHERES, fractions) if not part.any()]
    if empty:
        raise ValueError(f"no voxel of the scan of {name} lies in its {empty[0]} white surface: are spaces mixed up?")
    image = np.rint(block_means(scan.data, reduction) * _IMAGE_LEVELS).astype(np.uint16)
    parts = np.stack([block_means(part, reduction) for part in fractions])
    return Example(name, image, np.rint(parts * _FRACTION_LEVELS).astype(np.uint8))


def block_means(data: Array, reduction: int) -> Float[Array, "i j k"]:
    """The means over blocks of ``reduction³`` voxels.

    Raises
    ------
    ValueError
        If the size of an axis is not a multiple of ``reduction``.
    """
    require_positive_integer(reduction, "reduction")
    if any(n % reduction for n in data.shape):
        raise ValueError(f"the volume has {data.shape} voxels; every axis must be a multiple of {reduction}")
    i, j, k = (n // reduction for n in data.shape)
    blocks = np.asarray(data, dtype=np.float64).reshape(i, reduction, j, reduction, k, reduction)
    return blocks.mean(axis=(1, 3, 5))


def reduced_volume(volume: Volume, reduction: int) -> Volume:
    """A volume with coarser voxels, each the mean of ``reduction³`` voxels, at the same position in world space."""
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ np.full(3, (reduction - 1) / 2)
    affine[:3, :3] *= reduction
    return Volume(block_means(volume.data, reduction), affine)


def read_examples(
    cohorts: Sequence[str | os.PathLike],
    split: str,
    reduction: int = 1,
    progress: Callable[[list], Iterable] = iter,
) -> list[Example]:
    """Read the examples of all scans of a split, from one or more cohorts on disk.

    Parameters
    ----------
    cohorts : sequence of path
        Folders in the format described in ``meshot.synth.cohorts.cohort``.
    split : str
        "train", "validation" or "test".
    reduction : int
    progress : callable
        Wraps the list of scans, for example tqdm.

    Raises
    ------
    ValueError
        If a folder is not a cohort, or no cohort has a scan in the split.
    """
    return [
        example(
            f"{subject.cohort.name}/{subject.name}",
            subject.standard().volume,
            {side: subject.surface("white", side, "standard") for side in HEMISPHERES},
            reduction,
        )
        for subject in progress(scans_of(cohorts, split))
    ]


def digest(examples: Sequence[Example]) -> str:
    """The SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        for part in (
            item.name.encode(),
            str(item.image.shape).encode(),
            item.image.tobytes(),
            item.fractions.tobytes(),
        ):
            total.update(part)
    return total.hexdigest()
