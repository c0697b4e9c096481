"""Template anatomy from the nilearn package: the MNI152 average and the fsaverage5 surfaces. Nothing is downloaded.

MNI152 (ICBM 2009a, symmetric, non-linear) is the average of 152 heads. fsaverage5 is part of FreeSurfer and is an
average of the surfaces of other people. Its shape is similar, but it is not the cortex of the MNI152 image.
"""

import dataclasses
import functools
from pathlib import Path
from typing import Literal

import numpy as np
import scipy.linalg
import scipy.ndimage
import torch

from meshot.extras import needing
from meshot.mesh import Mesh, solid_moments
from meshot.types import Array, Bool, Float
from meshot.volume import StandardScan, Volume, place_on_grid, resample, transform_points, voxel_sizes

with needing("cortex"):
    import nilearn.datasets
    import nilearn.surface

Hemisphere = Literal["left", "right"]
HEMISPHERES: tuple[Hemisphere, ...] = ("left", "right")
#: From MNI305, the space of fsaverage, to MNI152: the matrix of FreeSurfer's wiki (CoordinateSystems).
MNI305_TO_MNI152 = np.array(
    [
        [0.9975, -0.0073, 0.0176, -0.0429],
        [0.0146, 1.0009, -0.0024, 1.5496],
        [-0.0130, -0.0093, 0.9971, 1.1840],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def mni152_t1() -> Volume:
    """The skull-stripped T1 average at 1 mm, with values in [0, 1] and zero outside the brain."""
    return _volume(nilearn.datasets.load_mni152_template(resolution=1))


def mni152_brain_mask() -> Volume:
    """The brain mask of the MNI152 average, as defined by nilearn: T1 above one fifth of its maximum. Boolean."""
    mask = _volume(nilearn.datasets.load_mni152_brain_mask(resolution=1))
    return mask.with_data(mask.data > 0)


def mni152_white_matter() -> Volume:
    """The white-matter map of the MNI152 average at 1 mm: at each voxel the mean of 152 segmentations, in [0, 1]."""
    return _volume(nilearn.datasets.load_mni152_wm_template(resolution=1))


def mni152_grey_matter() -> Volume:
    """The grey-matter map of the MNI152 average at 1 mm, in [0, 1]."""
    return _volume(nilearn.datasets.load_mni152_gm_template(resolution=1))


def fsaverage5_surface(
    kind: Literal["white", "pial"], hemisphere: Hemisphere, space: Literal["MNI305", "MNI152"] = "MNI305"
) -> Mesh:
    """One of FreeSurfer's average surfaces, in mm.

    The mesh has 10 242 vertices in float64, is closed, and is oriented outwards. Its own space is MNI305. In MNI152 its
    vertices are moved by the affine matrix of FreeSurfer's documentation.

    Raises
    ------
    ValueError
        If ``kind``, ``hemisphere`` or ``space`` is unknown.
    """
    if space not in ("MNI305", "MNI152"):
        raise ValueError(f"space is {space!r}; MNI305 or MNI152 is needed")
    if kind not in ("white", "pial") or hemisphere not in HEMISPHERES:
        raise ValueError(f"no surface {kind!r} {hemisphere!r}; kind is white or pial, hemisphere left or right")
    path = Path(nilearn.datasets.__file__).parent / "data" / "fsaverage5" / f"{kind}_{hemisphere}.gii.gz"
    surface = nilearn.surface.load_surf_mesh(str(path))
    vertices, faces = np.array(surface.coordinates, dtype=np.float64), np.array(surface.faces, dtype=np.int64)
    points = torch.from_numpy(vertices)
    points = points if space == "MNI305" else transform_points(MNI305_TO_MNI152, points)
    return Mesh(points, torch.from_numpy(faces))


def _volume(image: object) -> Volume:
    return Volume(np.asarray(image.dataobj, dtype=np.float32), image.affine)


# Placement of a scan on the standard grid by its white matter.
#
# A registration of grey values depends on what surrounds the brain: it makes a head with its skull smaller by a sixth,
# because the template has none. White matter is the same with and without a skull.

#: The grid has room for a cerebrum that is this much larger than that of MNI152, and its voxels are then finer. Of the
#: 144 voxels along its longest axis, the pial surfaces of fsaverage5 take 130.
ENLARGEMENT = 1.08
#: The scales of a plausible placement, relative to the first registration.
PLAUSIBLE_SCALES = (0.6, 1.8)
_FEWEST_VOXELS = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class Moments:
    """Mean (mm) and covariance (mm²) of a mass in space."""

    mean: Float[Array, " 3"]
    covariance: Float[Array, "3 3"]


def moments_of(mask: Volume) -> Moments:
    """The moments of the voxels of a mask."""
    places = np.argwhere(mask.data) @ mask.affine[:3, :3].T + mask.affine[:3, 3]
    if len(places) < _FEWEST_VOXELS:
        raise ValueError(f"the mask has {len(places)} voxels; {_FEWEST_VOXELS} or more are needed for its moments")
    return Moments(places.mean(axis=0), np.cov(places.T))


def gaussian_transport(source: Moments, target: Moments) -> Float[Array, "4 4"]:
    """The affine map that is the optimal transport between the normal distributions with these moments."""
    # Its linear part is symmetric and positive definite: it scales along three orthogonal axes and turns nothing.
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
    if not PLAUSIBLE_SCALES[0] <= scales.min() <= scales.max() <= PLAUSIBLE_SCALES[1]:
        raise ValueError(
            f"the white matter would have to be scaled by {scales.min():.2f} to {scales.max():.2f}; "
            f"{PLAUSIBLE_SCALES[0]} to {PLAUSIBLE_SCALES[1]} are plausible: was white matter of both sides found?"
        )
    # Rounded, because the last bits differ between processors.
    to_standard = (_enlargement() @ moved @ first.to_standard).round(6)
    placed = place_on_grid(scan, to_standard, _grid_centre())
    grid, to_first = placed.volume, np.linalg.inv(to_standard @ np.linalg.inv(first.to_standard))
    mask = white.with_data((white.data > 0).astype(np.uint8))
    moved_mask = resample(mask, grid.data.shape, grid.affine, to_first, order=0).data.astype(bool)
    return dataclasses.replace(placed, volume=contrast_by_white_matter(grid, moved_mask))


def in_mni152(mesh: Mesh) -> Mesh:
    """A mesh of the enlarged standard space in MNI152 coordinates, in mm."""
    return mesh.with_vertices(transform_points(np.linalg.inv(_enlargement()), mesh.vertices))


def from_mni152(mesh: Mesh) -> Mesh:
    """A mesh of MNI152 coordinates in the enlarged standard space, in mm."""
    return mesh.with_vertices(transform_points(_enlargement(), mesh.vertices))


def enlarged(volume: Volume) -> Volume:
    """A volume of MNI152 coordinates, such as the average itself, in the enlarged standard space."""
    return Volume(volume.data, _enlargement() @ volume.affine)


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


# The contrast of a scan, adjusted by its white matter: no bias field, and the same levels in every scan.
#
# FreeSurfer and other pipelines bring white matter to one value before they look for its surface. Here grey matter is
# brought to one value, too.

#: The values of white matter and of the grey matter beside it, in [0, 1].
WHITE, GREY = 0.75, 0.5
#: Standard deviation of the Gaussian that smooths the values of white matter, in mm.
BIAS_MM = 18.0
_CORE_VOXELS, _RING_VOXELS = 2, (1, 2)  # inside the border of white matter, and outside it
_OUTLIER = 0.35  # relative to the median of white matter
_REGULARISATION = 1e-3
_LEVELS, _SMOOTHING = np.linspace(0.2, 1.2, 101), 3.0  # of the histogram of grey matter, relative to white
#: The range of grey matter relative to white in which the values are moved.
PLAUSIBLE_GREY = (0.3, 0.92)


def contrast_by_white_matter(volume: Volume, white: Bool[Array, "X Y Z"]) -> Volume:
    """A scan without bias field, in which white matter has the value .75 and the cortex .5.

    The scan is divided by the smoothed values of its white matter. The level of grey matter is the commonest value in
    a shell around the white matter. A piecewise linear map then moves both levels, and keeps 0. If grey matter is not
    darker than white matter, the levels are left as they are; only the bias field is removed.

    Parameters
    ----------
    volume : Volume
        In [0, 1], for example on the standard grid.
    white : array
        A mask: the inside of the white surfaces of both sides. Small errors of it do not matter.

    Raises
    ------
    ValueError
        If the mask is so thin that no voxel lies two voxels inside it, or the scan is mostly 0 there.

    References
    ----------
    Dale, Fischl and Sereno, *Cortical surface-based analysis I*, NeuroImage 1999 (the value of white matter).
    """
    # The bias field, in units of the scan: the values inside white matter, smoothed and continued.
    core = scipy.ndimage.binary_erosion(white, iterations=_CORE_VOXELS)
    if not core.any():
        raise ValueError(f"no voxel of the white matter lies {_CORE_VOXELS} voxels inside it: was white matter found?")
    median = np.median(volume.data[core])
    if not median > 0:
        raise ValueError(f"the median of the white matter is {median:.3g}; a positive one is needed: is the scan a T1?")
    core &= np.abs(volume.data - median) <= _OUTLIER * median
    lengths = BIAS_MM / voxel_sizes(volume)
    weight, total = (
        scipy.ndimage.gaussian_filter(np.where(core, part, 0).astype(np.float64), lengths, truncate=3.0)
        for part in (1.0, volume.data)
    )
    mean = float(volume.data[core].mean(dtype=np.float64))
    relative = volume.data / ((total + _REGULARISATION * mean) / (weight + _REGULARISATION))
    # The commonest value beside white matter, relative to white matter; 1 if there is none.
    inner, outer = (scipy.ndimage.binary_dilation(white, iterations=n) for n in _RING_VOXELS)
    values, grey = relative[outer & ~inner], 1.0
    counts, ends = np.histogram(values, _LEVELS)
    if counts.any():
        smooth, width = scipy.ndimage.gaussian_filter1d(counts.astype(float), _SMOOTHING), np.diff(ends)[0]
        near = values[np.abs(values - (ends[smooth.argmax()] + width / 2)) < 4 * _SMOOTHING * width]
        # Rounded, because the last bits differ between processors.
        grey = round(float(np.median(near)), 3)
    if not PLAUSIBLE_GREY[0] <= grey <= PLAUSIBLE_GREY[1]:
        return volume.with_data((WHITE * relative).clip(0, 1).astype(volume.data.dtype))
    top = 1 + (1 - grey) * (1 - WHITE) / (WHITE - GREY)
    moved = np.interp(relative, [0, grey, 1, top], [0, GREY, WHITE, 1])
    return volume.with_data(moved.astype(volume.data.dtype))
