"""Thickness and volume of the cortex between a white and a pial surface whose vertices correspond."""

import numpy as np
import torch

from meshot.errors import require_positive
from meshot.mesh import Mesh
from meshot.metrics.distances import vertex_distances
from meshot.types import Array, Float

#: FreeSurfer counts no thickness beyond this, in mm.
LARGEST_THICKNESS_MM = 5.0


def cortical_thickness(white: Mesh, pial: Mesh, largest: float = LARGEST_THICKNESS_MM) -> Float[Array, " V"]:
    """The thickness of the cortex at every vertex, in units of the vertices.

    It is the mean of two distances: from the white vertex to the nearest point of the pial surface, and from the pial
    vertex to the nearest point of the white surface.

    Parameters
    ----------
    white, pial : Mesh
        With the same faces, so that their vertices correspond.
    largest : float
        Larger distances count as this. 5 mm, as in FreeSurfer.

    Raises
    ------
    ValueError
        If the faces differ, a vertex is not finite, or ``largest`` is not positive.

    References
    ----------
    Fischl and Dale, *Measuring the thickness of the human cerebral cortex from magnetic resonance images*, 2000.

    Examples
    --------
    >>> from meshot.mesh import icosphere
    >>> from meshot.metrics import cortical_thickness
    >>> inner, outer = icosphere(4, radius=30.0), icosphere(4, radius=32.5)
    >>> float(cortical_thickness(inner, outer).mean().round(2))
    2.5
    """
    require_corresponding(white, pial)
    require_positive(largest, "largest")
    ways = (np.minimum(vertex_distances(*pair), largest) for pair in ((white, pial), (pial, white)))
    return sum(ways) / 2


def cortical_volumes(white: Mesh, pial: Mesh) -> Float[Array, " V"]:
    """The volume between both surfaces at every vertex: a third of that of the faces around it, in cubed units.

    Between a white face and its pial face lies a prism of three tetrahedra. Prisms share their sides with their
    neighbours. So the sum over all vertices of closed surfaces is the difference of what they enclose. A volume is
    negative where the pial face lies inside the white one.

    Raises
    ------
    ValueError
        If the faces of the surfaces differ.
    """
    require_corresponding(white, pial)
    # Each side of a prism is divided from the white corner with the lower number to the other pial corner.
    faces, order = white.faces.sort(dim=1)
    even = torch.tensor([[0, 1, 2], [1, 2, 0], [2, 0, 1]], device=order.device)
    signs = torch.where((order[:, None] == even).all(dim=2).any(dim=1), 1.0, -1.0)
    w, p = (mesh.vertices.detach().double()[faces].unbind(dim=1) for mesh in (white, pial))
    tetrahedra = ((w[0], w[1], w[2], p[2]), (w[0], w[1], p[2], p[1]), (w[0], p[1], p[2], p[0]))
    prisms = sum(_signed(*corners) for corners in tetrahedra) * signs
    sums = torch.zeros(len(white.vertices), dtype=torch.float64, device=prisms.device)
    return sums.index_add(0, faces.flatten(), (prisms / 3).repeat_interleave(3)).cpu().numpy()


def _signed(a: Float[torch.Tensor, "n 3"], *others: Float[torch.Tensor, "n 3"]) -> Float[torch.Tensor, " n"]:
    """The volume of tetrahedra, positive if the last corner lies on the outer side of the first three."""
    b, c, d = (other - a for other in others)
    return (torch.linalg.cross(b, c) * d).sum(dim=1) / 6


def corresponds(white: Mesh, pial: Mesh | None) -> bool:
    """Whether there is a pial surface, and its vertices correspond to those of the white one: it has the same faces."""
    if pial is None or len(white.vertices) != len(pial.vertices):
        return False
    return torch.equal(white.faces.cpu(), pial.faces.cpu())


def require_corresponding(white: Mesh, pial: Mesh) -> None:
    """Check that the vertices of two surfaces correspond."""
    if not corresponds(white, pial):
        raise ValueError(
            f"the white surface has {len(white.vertices)} vertices and {len(white.faces)} faces, the pial one "
            f"{len(pial.vertices)} and {len(pial.faces)}, or other faces; the same faces are needed, so that vertices "
            "correspond: pass two surfaces of one person by one program"
        )
