"""A surface moved outwards or inwards by some mm, without crossing itself where it would meet its own other bank."""

import numpy as np
import scipy.ndimage
import torch

from meshot.flow.fields import spline_values
from meshot.mesh import Mesh
from meshot.mesh.geometry import safe_norm, signed_volume
from meshot.types import Float, Tensor
from meshot.volume import Volume
from meshot.volume.surfaces import winding_numbers

_VOXEL = 1.0  # mm
_BLUR = 1.3  # mm
_FLAT = 0.02  # per mm: below it the blurred edge has no direction
_STEP = 0.25  # mm
_MARGIN = 4.0  # mm, beyond the largest distance


def offset_surface(mesh: Mesh, distances: Float[Tensor, " V"]) -> Mesh:
    """Every vertex of a closed surface carried that far outwards (mm; inwards if negative), or as far as there is room.

    The vertices follow the flow of one smooth field: down the gradient of the enclosed space, blurred by 1.3 mm, at
    unit speed, and slower where banks face each other, where the gradient vanishes. Trajectories do not meet, so a
    sulcus closes up to a slit and its banks stop there. A vertex halts when it is as far from where it began as asked
    for, or when the time for the farthest is twice over.

    Parameters
    ----------
    mesh : Mesh
        With an inside, its normals outward.
    distances : tensor
        All of one sign.

    Raises
    ------
    ValueError
        If the distances have two signs, their number is not that of the vertices, or the mesh is open or inverted.

    Notes
    -----
    Corners do not cross; faces between them may, in slits narrower than an edge is long: count them.
    """
    if len(distances) != len(mesh.vertices) or float(distances.min()) * float(distances.max()) < 0:
        raise ValueError(
            f"{len(distances)} distances from {float(distances.min()):.3g} to {float(distances.max()):.3g} mm came for "
            f"{len(mesh.vertices)} vertices; one for each, all of one sign, is needed"
        )
    if float(signed_volume(mesh)) <= 0:
        raise ValueError("the mesh encloses a negative volume: its normals point inward; flip its faces")
    farthest = float(distances.abs().max())
    if farthest == 0:
        return mesh
    coefficients, lower = _outward_field(mesh, farthest + _MARGIN)
    step = _STEP if float(distances.sum()) > 0 else -_STEP

    def velocity(points: Tensor) -> Tensor:
        return spline_values(coefficients, (points - lower) / _VOXEL)

    start, wanted = mesh.vertices, distances.abs()
    place, reached = start, torch.zeros_like(wanted)
    result = start
    for _ in range(int(np.ceil(2 * farthest / _STEP))):
        following = place + step * velocity(place + step / 2 * velocity(place))
        reaches = safe_norm(following - start)
        part = ((wanted - reached) / (reaches - reached).clamp(min=1e-9)).clamp(0, 1)
        moving = reached < wanted  # halted vertices are left where they are
        result = torch.where(moving[:, None], place + part[:, None] * (following - place), result)
        reached = torch.where(moving, torch.maximum(reaches, reached), reached)
        place = torch.where(moving[:, None], following, place)
    return mesh.with_vertices(result)


def _outward_field(mesh: Mesh, margin: float) -> tuple[Float[Tensor, "X Y Z 3"], Float[Tensor, " 3"]]:
    """Spline coefficients of the field on a grid around the mesh, and where its first node lies."""
    vertices = mesh.vertices.detach()
    lower = torch.floor(vertices.amin(dim=0) - margin)
    shape = [int(n) for n in torch.ceil((vertices.amax(dim=0) + margin - lower) / _VOXEL)]
    affine = np.diag([_VOXEL, _VOXEL, _VOXEL, 1.0])
    affine[:3, 3] = lower.numpy()
    # Deep folds may cross and leave a pocket inside out; it counts as outside.
    inside = winding_numbers(mesh, Volume(np.zeros(shape, dtype=np.float32), affine), n_lines=2).clip(0, 1)
    orders = np.eye(3, dtype=int).tolist()
    downhill = np.stack([-scipy.ndimage.gaussian_filter(inside, _BLUR / _VOXEL, order=o) for o in orders], axis=-1)
    downhill /= _VOXEL
    speed = np.linalg.norm(downhill, axis=-1, keepdims=True)
    return torch.from_numpy(downhill / (speed + _FLAT)).to(vertices), lower
