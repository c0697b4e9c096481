"""Level sets of volumes as meshes, by marching cubes, in mm of scanner RAS."""

import numpy as np
import torch

from meshot.extras import needing
from meshot.mesh import Mesh
from meshot.types import Array, Bool
from meshot.volume.volume import Volume, voxel_to_mm

with needing("cortex"):
    import skimage.measure


def isosurface(volume: Volume, level: float = 0.5) -> Mesh:
    """The closed level set of a volume, by marching cubes, with outward normals.

    The volume is padded by one voxel with its minimum, so that the surface is closed even if the object reaches the
    border. The vertices are transformed by the affine once. If the affine is a reflection, faces are reversed.

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
        If no voxel, or every voxel, is above the level.

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
    """A field that is above a level exactly on a mask, and unchanged where field and mask already agree.

    Marching cubes of the result has the topology of the mask, and positions between voxels as in the field. Values on
    the wrong side are reflected at the level, which gives slits and bridges about one voxel wide.

    Parameters
    ----------
    field : Volume
    mask : array
        Boolean, of the shape of the field.
    level : float
        In the units of the field.
    margin : float
        Values closer than this to the level are moved away from it. Otherwise vertices close to voxel centres would
        give degenerate triangles.

    Raises
    ------
    ValueError
        If the mask has another shape than the field.
    """
    if mask.shape != field.data.shape:
        raise ValueError(f"mask has shape {mask.shape}; {field.data.shape} is needed, one value for each voxel")
    away = np.maximum(np.abs(field.data - level), margin)
    return field.with_data(np.where(mask, level + away, level - away))
