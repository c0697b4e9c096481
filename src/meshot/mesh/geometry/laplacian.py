"""Uniform and cotangent Laplacians of the vertex positions, and mean curvature."""

import torch

from meshot.mesh.geometry.areas import face_areas, face_corners, mesh_edges, safe_norm, vertex_areas
from meshot.mesh.mesh import Contour, Mesh
from meshot.types import Float, Int64, Tensor


def umbrella_vectors(shape: Mesh | Contour) -> Float[Tensor, "V d"]:
    """The vector from every vertex to the mean of its neighbours (uniform Laplacian), in units of the vertices.

    The part along the normal measures curvature. The tangential part measures uneven spacing of the vertices. At a
    boundary the vector points inwards.

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
    """The cotangent of the angle at each corner of every face; zero in a face without area."""
    corners = face_corners(mesh)
    double_areas = 2 * face_areas(mesh)
    flat = double_areas == 0
    to_next, to_previous = corners.roll(-1, dims=1) - corners, corners.roll(1, dims=1) - corners
    dots = (to_next * to_previous).sum(dim=2)
    return torch.where(flat[:, None], torch.zeros_like(dots), dots / torch.where(flat, 1, double_areas)[:, None])


def cotangent_vectors(mesh: Mesh, detach_weights: bool = False) -> tuple[Float[Tensor, "V 3"], Float[Tensor, " V"]]:
    """The sums Σⱼ wᵢⱼ (xⱼ − xᵢ) and Σⱼ wᵢⱼ over the neighbours of every vertex i, with cotangent weights.

    The weights are wᵢⱼ = ½ (cot α + cot β), where α and β are the angles opposite to the edge. A boundary edge has one
    such angle; an edge of several faces has one term for each. The first sum is minus the gradient of the total area,
    in units of the vertices. At interior vertices of a smooth surface it is approximately normal to the surface, also
    for uneven vertices. The weights have no unit. A weight is negative if the two angles add up to more than π, but
    the sum around a vertex of a face with positive area is positive, because the other two angles of a triangle add up
    to less than π.

    Parameters
    ----------
    mesh : Mesh
    detach_weights : bool
        Treat the weights as constants in the gradient, as PyTorch3D does.

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
    # The angle at a corner is opposite to the edge between the other two corners.
    starts, ends = faces.roll(-1, dims=1), faces.roll(1, dims=1)
    weights = torch.cat([halves.flatten()] * 2)
    rows, others = torch.cat([starts.flatten(), ends.flatten()]), torch.cat([ends.flatten(), starts.flatten()])
    arrows = weights[:, None] * (vertices[others] - vertices[rows])
    sums = torch.zeros_like(vertices).index_add(0, rows, arrows)
    return sums, torch.zeros_like(vertices[:, 0]).index_add(0, rows, weights)


def mean_curvatures(mesh: Mesh) -> Float[Tensor, " V"]:
    """The unsigned mean curvature at every vertex, in 1/units of the vertices: 1/r on a sphere of radius r.

    It is half the norm of the gradient of the area, divided by a third of the area of the faces around the vertex. It
    is meaningful at interior vertices only. At a vertex whose faces all have zero area it is zero.

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
