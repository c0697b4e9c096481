"""What other programs read beside surfaces: the transform for ITK and FreeSurfer, and white matter as labels."""

import numpy as np
from scipy.ndimage import affine_transform

from meshot.anatomy import HEMISPHERES
from meshot.pipeline.reconstruction import Reconstruction
from meshot.types import Array, Float
from meshot.volume import Volume, centre_ras, voxel_sizes

_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
#: What BIDS and TemplateFlow call the template of :func:`meshot.anatomy.mni152_t1`.
TEMPLATE = "MNI152NLin2009aSym"


def itk_transform(to_standard: Float[Array, "4 4"]) -> str:
    """The text of an ITK transform that resamples the scan to the template, for ANTs, SimpleITK and 3D Slicer.

    ITK counts in LPS, and its transforms take points of the image that is made to points of the image that is read:
    here points of the template to points of the scan.

    Parameters
    ----------
    to_standard : array
        Takes scanner RAS to the template, in mm.
    """
    matrix = _LPS @ np.linalg.inv(to_standard) @ _LPS
    numbers = " ".join(f"{value:.17g}" for value in [*matrix[:3, :3].ravel(), *matrix[:3, 3]])
    return (
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        f"Parameters: {numbers}\nFixedParameters: 0 0 0\n"
    )


def lta_transform(to_standard: Float[Array, "4 4"], scan: Volume, scan_name: str, template: Volume) -> str:
    """The text of a FreeSurfer transform (LTA, scanner RAS to scanner RAS) from the scan to the template.

    Parameters
    ----------
    to_standard : array
        Takes scanner RAS to the template, in mm.
    scan, template : Volume
        Their grids are written down.
    scan_name : str
        The file of the scan.
    """
    rows = "\n".join(" ".join(f"{value:.15e}" for value in row) for row in to_standard)
    return (
        "type      = 1 # LINEAR_RAS_TO_RAS\nnxforms   = 1\nmean      = 0.0000 0.0000 0.0000\nsigma     = 1.0000\n"
        f"1 4 4\n{rows}\nsrc volume info\n{_grid(scan, scan_name)}dst volume info\n{_grid(template, TEMPLATE)}"
    )


def _grid(volume: Volume, name: str) -> str:
    sizes = voxel_sizes(volume)
    axes = (volume.affine[:3, :3] / sizes).T
    lines = [
        "valid = 1  # volume info valid",
        f"filename = {name}",
        "volume = " + " ".join(map(str, volume.data.shape)),
        "voxelsize = " + " ".join(f"{value:.15e}" for value in sizes),
    ]
    for key, values in zip(("xras", "yras", "zras", "cras"), (*axes, centre_ras(volume)), strict=True):
        lines.append(f"{key}   = " + " ".join(f"{value:.15e}" for value in values))
    return "\n".join(lines) + "\n"


def white_matter_labels(
    found: Reconstruction, grid: Volume, values: tuple[int, int] = (1, 2), genus_zero: bool = False
) -> Volume:
    """White matter on a grid in scanner space: one value for the left, one for the right, 0 elsewhere.

    The segmentation is on the standard grid. It is interpolated linearly, and a voxel is inside above ½.

    Parameters
    ----------
    found : Reconstruction
    grid : Volume
        Its shape and affine count: usually the scan.
    values : two int
        For left and right.
    genus_zero : bool
        Whether to take the part that has the topology of a ball, from which the initial surface is made.
    """
    labels = np.zeros(grid.data.shape, dtype=np.uint8)
    for side, value in zip(HEMISPHERES, values, strict=True):
        segmented = found.surfaces[side].segmented
        mask = segmented.genus_zero_mask if genus_zero else segmented.mask
        to_voxel = np.linalg.inv(mask.affine) @ found.scan.to_standard @ grid.affine
        inside = affine_transform(
            mask.data.astype(np.float32), to_voxel[:3, :3], to_voxel[:3, 3], grid.data.shape, order=1
        )
        labels[inside > 0.5] = value
    return grid.with_data(labels)
