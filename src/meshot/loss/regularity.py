"""What a shape should look like, whatever the target: short edges, vertices amid their neighbours, no sharp turns."""

import torch

from meshot.mesh.geometry import edge_lengths, edge_normals, mesh_edges
from meshot.mesh.mesh import Contour, Mesh
from meshot.types import Float, Int64, Tensor


def squared_edge_length(shape: Mesh | Contour) -> Float[Tensor, ""]:
    """The mean squared edge length, in squared units of the vertices: every edge is a spring that wants to vanish.

    On a closed contour of given length it is least when all edges are equally long. PyTorch3D's ``mesh_edge_loss``
    with target length zero.
    """
    return edge_lengths(shape).square().mean()


def squared_laplacian(shape: Mesh | Contour) -> Float[Tensor, ""]:
    """The mean squared distance of every vertex from the mean of its neighbours (uniform Laplacian).

    In squared units of the vertices. PyTorch3D's ``mesh_laplacian_smoothing`` takes the distance without the square.

    Raises
    ------
    ValueError
        If a vertex has no neighbour.
    """
    edges = shape.edges if isinstance(shape, Contour) else mesh_edges(shape)
    vertices = shape.vertices
    ends, starts = edges.flatten(), edges.flip(1).flatten()
    n_neighbours = torch.bincount(ends, minlength=len(vertices))
    if bool((n_neighbours == 0).any()):
        raise ValueError(
            f"vertex {int((n_neighbours == 0).nonzero()[0])} belongs to no edge; remove vertices that nothing uses"
        )
    neighbours = torch.zeros_like(vertices).index_add(0, ends, vertices[starts]) / n_neighbours[:, None]
    return (neighbours - vertices).square().sum(dim=1).mean()


def normal_inconsistency(contour: Contour) -> Float[Tensor, ""]:
    """The mean of 1 − cos φ over the vertices, φ the angle by which the contour turns there: in [0, 2], without unit.

    Raises
    ------
    ValueError
        If a vertex is not the end of one edge and the start of one other.
    """
    normals = edge_normals(contour)
    before, after = _edges_around(contour)
    return (1 - (normals[before] * normals[after]).sum(dim=1)).mean()


def _edges_around(contour: Contour) -> tuple[Int64[Tensor, " V"], Int64[Tensor, " V"]]:
    """For every vertex, the edge that ends there and the edge that starts there."""
    start, end = contour.edges.unbind(dim=1)
    every = torch.arange(len(contour.vertices), device=start.device)
    if not (torch.equal(start.sort().values, every) and torch.equal(end.sort().values, every)):
        raise ValueError(
            "a vertex of the contour does not have exactly one edge in and one edge out; normal consistency is defined "
            "on closed contours whose edges run one way round"
        )
    return end.argsort(), start.argsort()
