"""Intersection of a surface with a plane."""

from meshot.mesh.mesh import Mesh
from meshot.types import Float, Tensor


def plane_section(mesh: Mesh, axis: int, position: float) -> Float[Tensor, "n 2 3"]:
    """The line segments in which the faces intersect the plane where coordinate ``axis`` equals ``position``.

    Exact up to rounding, with one segment for each face that crosses the plane. A vertex on the plane counts as above
    it, so that a closed surface gives closed lines. A face that touches the plane only from above gives no segment; one
    that touches it from below with a corner gives a segment of length zero.

    Parameters
    ----------
    mesh : Mesh
    axis : int
        0, 1 or 2.
    position : float
        In units of the vertices.

    Returns
    -------
    tensor
        The two ends of each segment. It has no rows if the plane does not intersect the surface.

    Raises
    ------
    ValueError
        If ``axis`` is not 0, 1 or 2.
    """
    if axis not in (0, 1, 2):
        raise ValueError(f"axis is {axis!r}; 0, 1 or 2 is needed (x, y or z)")
    height = mesh.vertices[:, axis] - position
    above = height >= 0
    crossing = mesh.faces[above[mesh.faces].any(dim=1) & ~above[mesh.faces].all(dim=1)]
    start, end = crossing, crossing.roll(-1, dims=1)
    cut = above[start] != above[end]  # two of the three edges of each crossing face
    start, end = start[cut], end[cut]
    fraction = (height[start] / (height[start] - height[end]))[:, None]
    points = mesh.vertices[start] + fraction * (mesh.vertices[end] - mesh.vertices[start])
    return points.reshape(-1, 2, 3)
