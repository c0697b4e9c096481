"""A third party's estimate of grey and white matter: the border between them, and the surface of the white matter."""

import dataclasses
from pathlib import Path

import numpy as np
import torch

from meshot.mesh import Mesh
from meshot.types import Array, Bool, Float
from meshot.volume import Volume, isosurface, largest_component, read_volume, voxel_to_mm

GREY, WHITE = 1, 2


@dataclasses.dataclass(frozen=True, eq=False)
class Estimate:
    """The parts of every voxel that are grey and white matter, in [0, 1], on one grid."""

    grey: Volume
    white: Volume

    def __post_init__(self):
        same = self.grey.data.shape == self.white.data.shape and np.allclose(self.grey.affine, self.white.affine)
        if not same:
            raise ValueError(f"grey matter is {self.grey} and white matter {self.white}, or their affines differ: both "
                             "must share one grid; take both from one segmentation")  # fmt: skip
        for name, part in (("grey", self.grey.data), ("white", self.white.data)):
            if part.min() < -1e-3 or part.max() > 1 + 1e-3:
                raise ValueError(
                    f"{name} matter ranges from {part.min():.4g} to {part.max():.4g}; parts of a voxel in [0, 1] are "
                    "needed: give a partial-volume map, not a scan or labels"
                )

    def brain(self) -> Bool[Array, "X Y Z"]:
        """The largest connected part of what is mostly grey or white matter: without objects outside the brain."""
        return largest_component(self.grey.data + self.white.data > 0.5)

    def labels(self) -> Array:
        """GREY or WHITE where that is the largest of the parts grey, white and fluid, within the brain; 0 elsewhere."""
        grey, white = self.grey.data, self.white.data
        parts = np.stack([1 - grey - white, grey, white])
        return np.where(self.brain(), parts.argmax(axis=0), 0)

    def white_surface(self) -> Mesh:
        """The surface where the white part is ½, by marching cubes, in mm, within the brain."""
        return isosurface(self.white.with_data(np.where(self.brain(), self.white.data, 0)))


def read_estimate(grey: Path, white: Path) -> Estimate:
    """The estimate from two files."""
    return Estimate(read_volume(grey), read_volume(white))


def border_squares(estimate: Estimate) -> Mesh:
    """The faces that a voxel of grey matter shares with one of white matter, two triangles each, in mm.

    Triangles 2k and 2k + 1 are those of square k. Their orientation has no meaning.
    """
    labels = estimate.labels()
    corners = np.concatenate([_squares(labels, axis) for axis in range(3)])
    if not len(corners):
        raise ValueError(
            "the estimate has no voxel of grey matter beside one of white matter; are the files exchanged?"
        )
    points = voxel_to_mm(estimate.white, torch.from_numpy(corners.reshape(-1, 3)))
    first = 4 * torch.arange(len(corners))[:, None]
    return Mesh(points, torch.cat([first + torch.tensor([0, 1, 2]), first + torch.tensor([0, 2, 3])], 1).reshape(-1, 3))


def square_centres(squares: Mesh) -> Float[Array, "n 3"]:
    """The centre of each square."""
    return squares.vertices.reshape(-1, 4, 3).mean(dim=1).numpy()


def _squares(labels: Array, axis: int) -> Float[Array, "n 4 3"]:
    """The corners, in voxel indices, of the border's faces across one axis."""
    before, after = np.moveaxis(labels, axis, 0)[:-1], np.moveaxis(labels, axis, 0)[1:]
    found = np.argwhere(before * after == GREY * WHITE).astype(np.float64)
    around = np.array([[0.5, a, b] for a, b in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))])
    corners = found[:, None] + around
    order = list(np.argsort([axis, *(k for k in range(3) if k != axis)]))
    return corners[..., order]
