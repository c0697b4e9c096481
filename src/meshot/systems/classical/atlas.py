"""What the classical system knows beforehand: where white matter may lie, and one threshold of the intensity."""

import math
from collections.abc import Sequence

import numpy as np
import scipy.ndimage
import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.types import Array, Bool, Float, Tensor
from meshot.volume import Volume, voxel_sizes
from meshot.volume.surfaces import enclosed_fractions

_ANYWHERE = 0.01  # smallest mean fraction that counts as white matter of a side
_DEEP = 0.9  # mean fraction from which a voxel counts as deep white matter


class Atlas(nn.Module):
    """The mean white matter of both sides over the training subjects, on a coarse grid, and a threshold.

    Parameters
    ----------
    shape : sequence of int
        Number of voxels of a scan along each axis.
    reduction : int
        Number of voxels of a scan along each axis in one voxel of the atlas.
    fractions : array, optional
        The atlas: the mean fraction of every coarse voxel that the white surfaces of left and right enclose. By default
        zero, until weights are loaded.
    level : float
        The initial threshold, relative to the intensity of deep white matter.

    Raises
    ------
    ValueError
        If the shape is not a multiple of the reduction.
    """

    def __init__(
        self, shape: Sequence[int], reduction: int = 4, fractions: Float[Array, "2 i j k"] | None = None,
        level: float = 0.8,
    ):  # fmt: skip
        super().__init__()
        require_positive_integer(reduction, "reduction", 16)
        if len(shape) != 3 or any(n % reduction or n < 2 * reduction for n in shape):
            raise ValueError(f"the scans have {tuple(shape)} voxels; every axis must be a multiple of {reduction}")
        self.shape, self.reduction = tuple(int(n) for n in shape), reduction
        coarse = [n // reduction for n in self.shape]
        values = torch.zeros(2, *coarse) if fractions is None else torch.from_numpy(fractions).float()
        self.register_buffer("fractions", values)
        self.level = nn.Parameter(torch.tensor(float(level)))

    def config(self) -> dict:
        """The arguments that create an atlas of the same shape."""
        return {"shape": list(self.shape), "reduction": self.reduction}

    def on_grid(self, image: Volume) -> Float[Array, "2 x y z"]:
        """The mean fractions of left and right at every voxel of a scan, by trilinear interpolation.

        Raises
        ------
        ValueError
            If the scan has another number of voxels than the scans of the training.
        """
        if image.data.shape != self.shape:
            raise ValueError(
                f"the scan has {image.data.shape} voxels, those of the training {self.shape}; bring it to the standard "
                "grid with standard_scan"
            )
        fine = nn.functional.interpolate(self.fractions[None].cpu(), self.shape, mode="trilinear", align_corners=False)
        return fine[0].numpy()

    def allowed(self, image: Volume, margin: float) -> Bool[Array, "2 x y z"]:
        """Where white matter of left and right may lie: at most ``margin`` mm from where it was in some subject."""
        fractions = self.on_grid(image)
        near = [
            scipy.ndimage.distance_transform_edt(each < _ANYWHERE, sampling=voxel_sizes(image)) <= margin
            for each in fractions
        ]
        own = fractions[0] >= fractions[1]
        nearer = np.where(fractions.max(axis=0) > 0, own, _nearer_to_first(near))
        return np.stack([near[0] & nearer, near[1] & ~nearer])

    def deep(self, image: Volume, share: float = _DEEP) -> Bool[Array, "2 x y z"]:
        """Where almost all subjects have white matter, or what a white surface encloses besides, such as ventricles."""
        fractions = self.on_grid(image)
        return fractions >= share * fractions.max(axis=(1, 2, 3), keepdims=True)


def _nearer_to_first(masks: list[Bool[Array, "x y z"]]) -> Bool[Array, "x y z"]:
    first, second = (scipy.ndimage.distance_transform_edt(~each) for each in masks)
    return first <= second


def mean_fractions(subjects: Sequence[tuple[Sequence[Mesh], Volume]], reduction: int) -> Float[Array, "2 i j k"]:
    """The mean over subjects of the fractions that their surfaces of left and right enclose, over blocks of voxels.

    Parameters
    ----------
    subjects : sequence of (surfaces of left and right, scan)
    reduction : int

    Raises
    ------
    ValueError
        If a surface is not closed, its normals point inwards, or an axis is not a multiple of ``reduction``.
    """
    total = [
        np.stack([_blocks(enclosed_fractions(mesh, image), reduction) for mesh in both]) for both, image in subjects
    ]
    return np.mean(total, axis=0)


def _blocks(data: Float[Array, "x y z"], reduction: int) -> Float[Array, "i j k"]:
    if any(n % reduction for n in data.shape):
        raise ValueError(f"the scan has {data.shape} voxels; every axis must be a multiple of {reduction}")
    i, j, k = (n // reduction for n in data.shape)
    return data.reshape(i, reduction, j, reduction, k, reduction).mean(axis=(1, 3, 5))


def whiteness(image: Volume, deep: Bool[Array, "x y z"], width: float, n_rounds: int) -> Volume:
    """The scan with a smooth gain field removed, relative to the intensity of deep white matter, which is near 1.

    In every round, bright voxels (above .85) count as white matter. The mean of their logarithms under a Gaussian is
    the logarithm of the gain. The method is a simple form of bias correction; N4 and FreeSurfer do more.

    Parameters
    ----------
    image : Volume
        In [0, 1].
    deep : array
        Boolean: deep white matter.
    width : float
        Standard deviation of the Gaussian, in mm.
    n_rounds : int
        With 0, only the scale changes.

    Raises
    ------
    ValueError
        If the scan is dark where deep white matter is expected.
    """
    middle = float(np.median(image.data[deep])) if deep.any() else 0.0
    if not middle > 0 or not math.isfinite(middle):
        raise ValueError(
            f"the median intensity in deep white matter is {middle:.4g}; a T1 on the standard grid is needed"
        )
    found, sigma = image.data.astype(np.float64) / middle, width / voxel_sizes(image)
    for _ in range(n_rounds):
        white = (found > 0.85) & (found < 1.3)
        weights = scipy.ndimage.gaussian_filter(white.astype(np.float64), sigma)
        logs = scipy.ndimage.gaussian_filter(np.where(white, np.log(np.maximum(found, 1e-6)), 0.0), sigma)
        found = found / np.exp(logs / np.maximum(weights, 1e-3))
        found = found / np.median(found[deep])
    return image.with_data(found)


def misfit(
    found: Float[Tensor, " n"], truth: Float[Tensor, " n"], level: Float[Tensor, ""], softness: float = 0.05
) -> Float[Tensor, ""]:
    """The mean squared difference between true fractions of voxels and a soft threshold of their whiteness."""
    return (torch.sigmoid((found - level) / softness) - truth).square().mean()
