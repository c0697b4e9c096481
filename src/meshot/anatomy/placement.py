"""Placement of a scan on the standard grid by its white matter.

A registration of grey values depends on what surrounds the brain: it makes a head with its skull smaller by a sixth,
because the template has none. White matter is the same with and without a skull.
"""

import dataclasses
import functools

import numpy as np
import scipy.linalg
import scipy.ndimage
import torch

from meshot.anatomy.contrast import contrast_by_white_matter
from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.mesh import Mesh
from meshot.mesh.geometry import solid_moments
from meshot.types import Array, Bool, Float
from meshot.volume import StandardScan, Volume, place_on_grid, transform_points

#: The grid has room for a cerebrum that is this much larger than that of MNI152, and its voxels are then finer. Of the
#: 144 voxels along its longest axis, the pial surfaces of fsaverage5 take 130.
ENLARGEMENT = 1.08
#: The scales of a plausible placement, relative to the first registration.
PLAUSIBLE = (0.6, 1.8)
_FEWEST_VOXELS = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class Moments:
    """Mean (mm) and covariance (mm²) of a mass in space."""

    mean: Float[Array, " 3"]
    covariance: Float[Array, "3 3"]


def moments_of(mask: Volume) -> Moments:
    """The moments of the voxels of a mask.

    Raises
    ------
    ValueError
        If the mask has fewer than 1000 voxels.
    """
    places = np.argwhere(mask.data) @ mask.affine[:3, :3].T + mask.affine[:3, 3]
    if len(places) < _FEWEST_VOXELS:
        raise ValueError(f"the mask has {len(places)} voxels; {_FEWEST_VOXELS} or more are needed for its moments")
    return Moments(places.mean(axis=0), np.cov(places.T))


def gaussian_transport(source: Moments, target: Moments) -> Float[Array, "4 4"]:
    """The affine map that is the optimal transport between the normal distributions with these moments.

    Its linear part is symmetric and positive definite: it scales along three orthogonal axes and turns nothing.

    Raises
    ------
    ValueError
        If a covariance is singular.

    References
    ----------
    Peyré and Cuturi, *Computational optimal transport*, 2019, remark 2.31.
    """
    root = _root(source.covariance)
    if np.linalg.cond(root) > 1e6:
        raise ValueError("the source is flat: its covariance is singular; a mass that fills space is needed")
    inverse = np.linalg.inv(root)
    made = np.eye(4)
    made[:3, :3] = inverse @ _root(root @ target.covariance @ root) @ inverse
    made[:3, 3] = target.mean - made[:3, :3] @ source.mean
    return made


def _root(matrix: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    values, vectors = scipy.linalg.eigh(matrix)
    return (vectors * np.sqrt(values.clip(min=0))) @ vectors.T


def placed_by_white_matter(scan: Volume, first: StandardScan, white: Volume) -> StandardScan:
    """A scan on the standard grid, so that mean and covariance of its white matter are those of fsaverage5.

    The transform is the first one, followed by the optimal transport map between the two normal distributions, and by
    an enlargement by ``ENLARGEMENT``. The map scales along three orthogonal axes and turns nothing. The contrast is
    adjusted by :func:`meshot.anatomy.contrast_by_white_matter`.

    Parameters
    ----------
    scan : Volume
    first : StandardScan
        The scan, registered by its grey values.
    white : Volume
        A mask on the grid of ``first``: the inside of the white surfaces of both sides.

    Raises
    ------
    ValueError
        If the mask has fewer than 1000 voxels, or a scale would change by a factor outside 0.6 to 1.8.

    References
    ----------
    Peyré and Cuturi, *Computational optimal transport*, 2019, remark 2.31.
    """
    moved = gaussian_transport(moments_of(white), _template_moments())
    scales = np.linalg.eigvalsh(moved[:3, :3])
    if not PLAUSIBLE[0] <= scales.min() <= scales.max() <= PLAUSIBLE[1]:
        raise ValueError(
            f"the white matter would have to be scaled by {scales.min():.2f} to {scales.max():.2f}; "
            f"{PLAUSIBLE[0]} to {PLAUSIBLE[1]} are plausible: was white matter of both sides found?"
        )
    # Rounded, because the last bits differ between processors.
    to_standard = (_enlargement() @ moved @ first.to_standard).round(6)
    placed = place_on_grid(scan, to_standard, _grid_centre())
    moved_mask = _on_grid(white, placed.volume, to_standard @ np.linalg.inv(first.to_standard))
    return dataclasses.replace(placed, volume=contrast_by_white_matter(placed.volume, moved_mask))


def _on_grid(mask: Volume, grid: Volume, to_grid: Float[Array, "4 4"]) -> Bool[Array, "X Y Z"]:
    """A mask after an affine motion, on another grid, by nearest neighbours."""
    to_voxel = np.linalg.inv(mask.affine) @ np.linalg.inv(to_grid) @ grid.affine
    return scipy.ndimage.affine_transform(
        (mask.data > 0).astype(np.uint8), to_voxel[:3, :3], to_voxel[:3, 3], grid.data.shape, order=0
    ).astype(bool)


def in_mni152(mesh: Mesh) -> Mesh:
    """A mesh of the enlarged standard space in MNI152 coordinates, in mm."""
    return mesh.with_vertices(transform_points(np.linalg.inv(_enlargement()), mesh.vertices))


def from_mni152(mesh: Mesh) -> Mesh:
    """A mesh of MNI152 coordinates in the enlarged standard space, in mm."""
    return mesh.with_vertices(transform_points(_enlargement(), mesh.vertices))


@functools.cache
def _template_moments() -> Moments:
    """Of the inside of both white surfaces of fsaverage5, in MNI152 coordinates."""
    parts = [solid_moments(fsaverage5_surface("white", side, "MNI152")) for side in HEMISPHERES]
    volumes = np.array([float(volume) for volume, _, _ in parts])
    means = np.stack([mean.numpy() for _, mean, _ in parts])
    shares = volumes / volumes.sum()
    mean = shares @ means
    within = sum(share * covariance.numpy() for share, (_, _, covariance) in zip(shares, parts))
    return Moments(mean, within + (shares[:, None] * (means - mean)).T @ (means - mean))


@functools.cache
def _grid_centre() -> Float[Array, " 3"]:
    """The centre of the bounding box of fsaverage5's pial surfaces, in MNI152 coordinates."""
    corners = torch.cat([fsaverage5_surface("pial", side, "MNI152").vertices for side in HEMISPHERES])
    return ((corners.min(dim=0).values + corners.max(dim=0).values) / 2).numpy()


def _enlargement() -> Float[Array, "4 4"]:
    made = np.diag([ENLARGEMENT] * 3 + [1.0])
    made[:3, 3] = (1 - ENLARGEMENT) * _grid_centre()
    return made
