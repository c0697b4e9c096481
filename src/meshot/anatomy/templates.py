"""Template anatomy from the nilearn package: the MNI152 average and the fsaverage5 surfaces. Nothing is downloaded.

MNI152 (ICBM 2009a, symmetric, non-linear) is the average of 152 heads. fsaverage5 is part of FreeSurfer and is an
average of the surfaces of other people. Its shape is similar, but it is not the cortex of the MNI152 image.
"""

from pathlib import Path
from typing import Literal

import numpy as np
import torch

from meshot.extras import needing
from meshot.mesh import Mesh
from meshot.volume import Volume, transform_points

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
