"""Checks of the meshes that are compared, with errors and warnings."""

import warnings

import numpy as np

from meshot.mesh import Mesh
from meshot.mesh.topology import boundary_edges, is_consistently_oriented, nonmanifold_edges
from meshot.metrics.distances import Surface

#: Ratios of the diagonals of two bounding boxes: above the first a warning is issued, above the second an error.
UNLIKE, ANOTHER_UNIT = 2, 10


def require_same_space(predicted: Surface, target: Surface) -> None:
    """Check that two surfaces overlap and have similar sizes. Otherwise the metrics would be meaningless.

    Raises
    ------
    ValueError
        If the bounding boxes (with a margin of 5 %) do not overlap, or one diagonal is ten times the other.

    Warns
    -----
    UserWarning
        If the boxes share less than half of the smaller one, or one diagonal is twice the other.
    """
    boxes = [(s.vertices.min(axis=0), s.vertices.max(axis=0)) for s in (predicted, target)]
    sizes = [float(np.linalg.norm(high - low)) for low, high in boxes]
    boxes = [(low - 0.05 * max(sizes), high + 0.05 * max(sizes)) for low, high in boxes]
    shared = np.minimum(boxes[0][1], boxes[1][1]) - np.maximum(boxes[0][0], boxes[1][0])
    where = " and ".join(f"{low.round(1).tolist()} to {high.round(1).tolist()}" for low, high in boxes)
    remedy = "are both in scanner RAS, in mm, and of the same hemisphere?"
    if (shared <= 0).any():
        raise ValueError(f"the surfaces do not overlap: they fill the boxes {where}; {remedy}")
    extents = f"the surfaces extend over {sizes[0]:.4g} and {sizes[1]:.4g}; {remedy}"
    if max(sizes) >= ANOTHER_UNIT * min(sizes):
        raise ValueError(extents)
    share = np.prod(shared) / min(np.prod(high - low) for low, high in boxes)
    if share < 0.5:
        warnings.warn(f"the boxes {where} around the surfaces share {share:.0%} of the smaller; {remedy}", stacklevel=3)
    elif max(sizes) >= UNLIKE * min(sizes):
        warnings.warn(extents, stacklevel=3)


def warn_of_defects(mesh: Mesh, name: str, volume: float) -> None:
    """Warn if a mesh is not a closed surface with outward normals, and say which metrics are affected.

    Warns
    -----
    UserWarning
        If the mesh is open, has non-manifold edges, is not consistently oriented, or is inside out. All defects are in
        one warning.
    """
    n_open, n_many = len(boundary_edges(mesh)), len(nonmanifold_edges(mesh))
    oriented = is_consistently_oriented(mesh)
    found = []
    if n_open:
        found.append(f"is open ({n_open} boundary edges), so that it encloses no volume")
    if n_many:
        found.append(f"has {n_many} edges of more than two faces, so that its Euler number is not that of a surface")
    if not n_many and not oriented:
        found.append("has neighbouring faces that look to opposite sides, which spoils volume and signed normals")
    elif not n_open and not n_many and volume < 0:
        found.append("is inside out (negative volume): turn its faces round with mesh.faces.flip(1)")
    if found:
        warnings.warn(f"the {name} mesh {'; it '.join(found)}; distances are valid nevertheless", stacklevel=3)
