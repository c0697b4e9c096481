"""Offset surfaces: a surface moved outwards or inwards by some mm, without self-intersection where walls would meet."""

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
_FLAT = 0.02  # per mm: below this slope the blurred edge has no reliable direction
_STEP = 0.25  # mm
_MARGIN = 4.0  # mm, beyond the largest distance


def offset_surface(mesh: Mesh, distances: Float[Tensor, " V"]) -> Mesh:
    """Move every vertex of a closed surface outwards by a distance in mm (inwards if negative), as far as possible.

    The vertices follow the flow of one smooth velocity field: the negative gradient of the enclosed volume's indicator
    function, blurred by 1.3 mm, scaled to unit speed. Where walls face each other, the gradient vanishes and the
    velocity is lower. Trajectories do not meet, so that the walls of a sulcus approach each other and stop. A vertex
    stops when its distance from the start is the requested one, or after twice the time for the largest distance.

    Parameters
    ----------
    mesh : Mesh
        Closed, with outward normals.
    distances : tensor
        All of one sign.

    Raises
    ------
    ValueError
        If the distances have different signs, their number is not that of the vertices, or the mesh is open or inside
        out.

    Notes
    -----
    Vertices do not meet, but faces between them may intersect in gaps narrower than an edge. Check the result.
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
        moving = reached < wanted  # the other vertices have stopped
        result = torch.where(moving[:, None], place + part[:, None] * (following - place), result)
        reached = torch.where(moving, torch.maximum(reaches, reached), reached)
        place = torch.where(moving[:, None], following, place)
    return mesh.with_vertices(result)


def _outward_field(mesh: Mesh, margin: float) -> tuple[Float[Tensor, "X Y Z 3"], Float[Tensor, " 3"]]:
    """Spline coefficients of the velocity field on a grid around the mesh, and the position of its first node."""
    vertices = mesh.vertices.detach()
    lower = torch.floor(vertices.amin(dim=0) - margin)
    shape = [int(n) for n in torch.ceil((vertices.amax(dim=0) + margin - lower) / _VOXEL)]
    affine = np.diag([_VOXEL, _VOXEL, _VOXEL, 1.0])
    affine[:3, 3] = lower.numpy()
    # Deep folds may intersect and have regions with winding number -1, which count as outside.
    inside = winding_numbers(mesh, Volume(np.zeros(shape, dtype=np.float32), affine), n_lines=2).clip(0, 1)
    orders = np.eye(3, dtype=int).tolist()
    downhill = np.stack([-scipy.ndimage.gaussian_filter(inside, _BLUR / _VOXEL, order=o) for o in orders], axis=-1)
    downhill /= _VOXEL
    speed = np.linalg.norm(downhill, axis=-1, keepdims=True)
    return torch.from_numpy(downhill / (speed + _FLAT)).to(vertices), lower
