"""The surface where a volume crosses a level, in scanner mm."""

import numpy as np
import torch

from meshot.extras import needing
from meshot.mesh import Mesh
from meshot.types import Array, Bool
from meshot.volume.volume import Volume, voxel_to_mm

with needing("cortex"):
    import skimage.measure


def isosurface(volume: Volume, level: float = 0.5) -> Mesh:
    """The closed surface around everything above a level, by marching cubes, with outward normals.

    The volume is padded by one voxel of its smallest value, so that the surface closes even where the object reaches
    the rim. Vertices leave voxel space through the affine, once; if that affine mirrors, faces are turned round.

    Parameters
    ----------
    volume : Volume
        A mask or a field that is larger inside.
    level : float
        In the units of the volume.

    Returns
    -------
    Mesh
        float64, in mm. Its topology is that of the voxels above the level if these are well-composed, see
        :func:`meshot.volume.surfaces.genus_zero`.

    Raises
    ------
    ValueError
        If no voxel, or every voxel, lies above the level.

    References
    ----------
    Lewiner et al., *Efficient Implementation of Marching Cubes' Cases with Topological Guarantees*, 2003.
    """
    data = volume.data.astype(np.float32)
    low, high = float(data.min()), float(data.max())
    if not low < level < high:
        raise ValueError(
            f"the volume ranges from {low:.4g} to {high:.4g}; the level ({level}) must lie strictly between"
        )
    vertices, faces, _, _ = skimage.measure.marching_cubes(
        np.pad(data, 1, constant_values=low), level, gradient_direction="descent", allow_degenerate=False
    )
    vertices = voxel_to_mm(volume, torch.from_numpy(vertices.astype(np.float64) - 1))
    faces = torch.from_numpy(np.ascontiguousarray(faces, dtype=np.int64))
    return Mesh(vertices, faces if np.linalg.det(volume.affine) < 0 else faces.flip(1))


def separated_field(field: Volume, mask: Bool[Array, "X Y Z"], level: float = 0.5, margin: float = 0.05) -> Volume:
    """A field that lies above a level exactly on a mask, and is left as it was wherever the two agree.

    Marching cubes then sees the topology of the mask, and places the surface between voxels as the field says. Voxels
    on the wrong side are reflected at the level, which leaves slits and bridges about a voxel wide.

    Parameters
    ----------
    field : Volume
    mask : array
        Boolean, of the shape of the field.
    level : float
        In the units of the field.
    margin : float
        Voxels closer than this to the level are moved away from it, so that no vertex comes near a voxel centre,
        where triangles degenerate.

    Raises
    ------
    ValueError
        If the mask has another shape than the field.
    """
    if mask.shape != field.data.shape:
        raise ValueError(f"mask has shape {mask.shape}; {field.data.shape} is needed, one value for each voxel")
    away = np.maximum(np.abs(field.data - level), margin)
    return field.with_data(np.where(mask, level + away, level - away))
