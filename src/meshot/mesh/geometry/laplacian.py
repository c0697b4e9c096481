"""Where a vertex lies against its neighbours: the umbrella vectors of the uniform and of the cotangent Laplacian."""

import torch

from meshot.mesh.geometry.areas import face_areas, face_corners, mesh_edges, safe_norm, vertex_areas
from meshot.mesh.mesh import Contour, Mesh
from meshot.types import Float, Int64, Tensor


def umbrella_vectors(shape: Mesh | Contour) -> Float[Tensor, "V d"]:
    """For every vertex the vector to the mean of its neighbours (uniform Laplacian), in units of the vertices.

    It mixes how the surface bends (its part along the normal) with how unevenly the vertices lie (its part along the
    surface); at a boundary it points inwards.

    Raises
    ------
    ValueError
        If a vertex has no neighbour.
    """
    edges = shape.edges if isinstance(shape, Contour) else mesh_edges(shape)
    vertices = shape.vertices
    ends, starts = edges.flatten(), edges.flip(1).flatten()
    n_neighbours = torch.bincount(ends, minlength=len(vertices))
    _require_used(n_neighbours, "edge")
    return torch.zeros_like(vertices).index_add(0, ends, vertices[starts]) / n_neighbours[:, None] - vertices


def cotangents(mesh: Mesh) -> Float[Tensor, "F 3"]:
    """The cotangent of the angle at each corner of every face, without unit; zero in a face without area."""
    corners = face_corners(mesh)
    double_areas = 2 * face_areas(mesh)
    flat = double_areas == 0
    to_next, to_previous = corners.roll(-1, dims=1) - corners, corners.roll(1, dims=1) - corners
    dots = (to_next * to_previous).sum(dim=2)
    return torch.where(flat[:, None], torch.zeros_like(dots), dots / torch.where(flat, 1, double_areas)[:, None])


def cotangent_vectors(mesh: Mesh, detach_weights: bool = False) -> tuple[Float[Tensor, "V 3"], Float[Tensor, " V"]]:
    """For every vertex i the sum Σⱼ wᵢⱼ (xⱼ − xᵢ) over its neighbours, and Σⱼ wᵢⱼ, with cotangent weights.

    wᵢⱼ = ½ (cot α + cot β), α and β the angles opposite to the edge; a boundary edge has one of them, an edge of
    several faces a summand for each. The sum of vectors is minus the gradient of the total area; for interior vertices
    it is normal to a smooth surface, however unevenly the vertices lie. In units of the vertices; the weights have
    none, are negative where the two angles add up to more than π, and add up to more than zero around every vertex of
    a face with area (the other two angles of a triangle add up to less than π).

    Parameters
    ----------
    mesh : Mesh
    detach_weights : bool
        Hold the weights fixed in the gradient, as PyTorch3D does.

    Raises
    ------
    ValueError
        If a vertex belongs to no face.

    References
    ----------
    Pinkall and Polthier, *Computing Discrete Minimal Surfaces and Their Conjugates*, 1993.
    """
    vertices, faces = mesh.vertices, mesh.faces
    _require_used(torch.bincount(faces.flatten(), minlength=len(vertices)), "face")
    halves = cotangents(mesh) / 2
    if detach_weights:
        halves = halves.detach()
    # The angle at a corner faces the edge between the other two.
    starts, ends = faces.roll(-1, dims=1), faces.roll(1, dims=1)
    weights = torch.cat([halves.flatten()] * 2)
    rows, others = torch.cat([starts.flatten(), ends.flatten()]), torch.cat([ends.flatten(), starts.flatten()])
    arrows = weights[:, None] * (vertices[others] - vertices[rows])
    sums = torch.zeros_like(vertices).index_add(0, rows, arrows)
    return sums, torch.zeros_like(vertices[:, 0]).index_add(0, rows, weights)


def mean_curvatures(mesh: Mesh) -> Float[Tensor, " V"]:
    """The unsigned mean curvature at every vertex, in 1/units of the vertices: 1/r on a sphere of radius r.

    Half the length of the area's gradient, over a third of the area of the faces around. Meaningful at interior
    vertices; at a vertex all of whose faces are without area it is zero.

    Raises
    ------
    ValueError
        If a vertex belongs to no face.

    References
    ----------
    Meyer, Desbrun, Schröder and Barr, *Discrete Differential-Geometry Operators for Triangulated 2-Manifolds*, 2003.
    """
    sums, _ = cotangent_vectors(mesh)
    areas = vertex_areas(mesh)
    positive = areas > 0
    curvatures = safe_norm(sums) / (2 * torch.where(positive, areas, torch.ones_like(areas)))
    return torch.where(positive, curvatures, torch.zeros_like(curvatures))


def _require_used(n_cells: Int64[Tensor, " V"], kind: str) -> None:
    if bool((n_cells == 0).any()):
        raise ValueError(
            f"vertex {int((n_cells == 0).nonzero()[0])} belongs to no {kind}; remove vertices that nothing uses"
        )
