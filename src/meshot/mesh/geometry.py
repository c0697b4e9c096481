"""Areas, normals, edges, curvature and plane sections of meshes, differentiable where possible.

All are functions of a mesh or a contour. Lengths are in units of the vertices, areas in their square. Normals point
outwards if the faces are consistently oriented.
"""

import itertools
from collections.abc import Iterable

import numpy as np
import torch

from meshot.errors import as_points, require_positive_integer
from meshot.mesh.mesh import Contour, Mesh
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Int, Int64, Tensor

# Lengths, areas, normals and volumes, differentiable in the vertices.


def face_corners(mesh: Mesh) -> Float[Tensor, "F 3 3"]:
    """The positions of the three corners of every face."""
    return mesh.vertices[mesh.faces]


def face_area_vectors(mesh: Mesh) -> Float[Tensor, "F 3"]:
    """The outward normal times the area of every face: half the cross product of two edges."""
    corners = face_corners(mesh)
    return torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def face_areas(mesh: Mesh) -> Float[Tensor, " F"]:
    """The area of every face, in squared units of the vertices. The gradient at a face without area is zero."""
    return safe_norm(face_area_vectors(mesh))


def face_normals(mesh: Mesh) -> Float[Tensor, "F 3"]:
    """The outward unit normal of every face; zero for a face without area."""
    vectors = face_area_vectors(mesh)
    return vectors / _lengths(vectors)


def vertex_normals(mesh: Mesh) -> Float[Tensor, "V 3"]:
    """The outward unit normal at every vertex: the area-weighted mean of its faces' normals; zero where they cancel."""
    vectors = face_area_vectors(mesh).repeat_interleave(3, dim=0)
    sums = torch.zeros_like(mesh.vertices).index_add(0, mesh.faces.flatten(), vectors)
    return sums / _lengths(sums)


def face_barycentres(mesh: Mesh) -> Float[Tensor, "F 3"]:
    """The mean of the three corners of every face."""
    return face_corners(mesh).mean(dim=1)


def vertex_areas(mesh: Mesh) -> Float[Tensor, " V"]:
    """A third of the area of the faces around every vertex. The sum is the area of the mesh."""
    thirds = (face_areas(mesh) / 3).repeat_interleave(3)
    return torch.zeros_like(mesh.vertices[:, 0]).index_add(0, mesh.faces.flatten(), thirds)


def signed_volume(mesh: Mesh) -> Float[Tensor, ""]:
    """The volume enclosed by a closed mesh, positive if its normals point outwards (divergence theorem)."""
    centred = mesh.with_vertices(mesh.vertices - mesh.vertices.mean(dim=0))
    return (face_barycentres(centred) * face_area_vectors(centred)).sum() / 3


def mesh_edges(mesh: Mesh) -> Int64[Tensor, "E 2"]:
    """Every edge once, as a sorted pair of vertex indices, in lexicographic order."""
    return edge_counts(mesh)[0]


def edge_counts(mesh: Mesh) -> tuple[Int64[Tensor, "E 2"], Int64[Tensor, " E"]]:
    """Every edge once, as in :func:`mesh_edges`, and the number of faces that it belongs to."""
    # Sorting one integer per edge is ten times faster than sorting rows.
    n_vertices = len(mesh.vertices)
    edges = directed_edges(mesh).sort(dim=1).values
    keys, counts = torch.unique(edges[:, 0] * n_vertices + edges[:, 1], return_counts=True)
    return torch.stack([keys // n_vertices, keys % n_vertices], dim=1), counts


def directed_edges(mesh: Mesh) -> Int64[Tensor, "H 2"]:
    """The three sides of every face, in its direction."""
    return torch.cat([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])


def edge_lengths(shape: Mesh | Contour) -> Float[Tensor, " E"]:
    """The length of every edge, in units of the vertices. Each edge of a mesh appears once."""
    edges = shape.edges if isinstance(shape, Contour) else mesh_edges(shape)
    return safe_norm(shape.vertices[edges[:, 1]] - shape.vertices[edges[:, 0]])


def edge_midpoints(contour: Contour) -> Float[Tensor, "E 2"]:
    """The midpoint of every edge of a contour."""
    return contour.vertices[contour.edges].mean(dim=1)


def edge_normals(contour: Contour) -> Float[Tensor, "E 2"]:
    """The unit normal to the right of every edge. It points outwards if the contour runs counter-clockwise."""
    along = contour.vertices[contour.edges[:, 1]] - contour.vertices[contour.edges[:, 0]]
    return torch.stack([along[:, 1], -along[:, 0]], dim=1) / _lengths(along)


def safe_norm(vectors: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
    """The Euclidean norm of every row, with gradient zero (not NaN) at zero."""
    squared = vectors.square().sum(dim=-1)
    positive = squared > 0
    return torch.where(
        positive, torch.where(positive, squared, torch.ones_like(squared)).sqrt(), torch.zeros_like(squared)
    )


def _lengths(vectors: Float[Tensor, "n d"]) -> Float[Tensor, "n 1"]:
    """The length of every row as a divisor: 1 for a row of zeros."""
    lengths = safe_norm(vectors)
    return torch.where(lengths > 0, lengths, torch.ones_like(lengths))[:, None]


# Moments of the solid that a closed mesh encloses.


def solid_moments(mesh: Mesh) -> tuple[Float[Tensor, ""], Float[Tensor, " 3"], Float[Tensor, "3 3"]]:
    """Volume, mean and covariance of the uniform mass inside a closed mesh with outward normals.

    The integrals over the solid are sums over the tetrahedra between the faces and one point.

    Raises
    ------
    ValueError
        If the enclosed volume is not positive.
    """
    origin = mesh.vertices.mean(dim=0)
    corners = (mesh.vertices - origin)[mesh.faces]
    sixfold = torch.linalg.det(corners)
    volume = sixfold.sum() / 6
    if not volume > 0:
        raise ValueError(f"the mesh encloses {float(volume):.4g}; a closed mesh with outward normals is needed")
    sums = corners.sum(dim=1)
    mean = (sixfold[:, None] * sums).sum(dim=0) / (24 * volume)
    products = torch.einsum("f,fi,fj->ij", sixfold, sums, sums)
    products = products + torch.einsum("f,fci,fcj->ij", sixfold, corners, corners)
    return volume, mean + origin, products / (120 * volume) - torch.outer(mean, mean)


# Uniform and cotangent Laplacians of the vertex positions, and mean curvature.


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
    to less than π. With ``detach_weights`` the weights are constants in the gradient, as in PyTorch3D.

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


def gaussian_curvatures(mesh: Mesh) -> Float[Tensor, " V"]:
    """The Gaussian curvature at every vertex, in 1/squared units of the vertices: 1/r² on a sphere of radius r.

    It is what the angles of the faces around the vertex lack to 2π, divided by a third of their area. Over a closed
    surface its integral is 2π times the Euler number. It is meaningful at interior vertices only. At a vertex whose
    faces all have zero area it is zero.

    References
    ----------
    Meyer, Desbrun, Schröder and Barr, *Discrete Differential-Geometry Operators for Triangulated 2-Manifolds*, 2003.
    """
    corners = face_corners(mesh)
    ahead, behind = (corners.roll(-1, dims=1) - corners), (corners.roll(1, dims=1) - corners)
    angles = torch.atan2(safe_norm(torch.linalg.cross(ahead, behind)), (ahead * behind).sum(dim=-1))
    around = torch.zeros_like(mesh.vertices[:, 0]).index_add(0, mesh.faces.flatten(), angles.flatten())
    areas = vertex_areas(mesh)
    positive = areas > 0
    curvatures = (2 * torch.pi - around) / torch.where(positive, areas, torch.ones_like(areas))
    return torch.where(positive, curvatures, torch.zeros_like(curvatures))


def _require_used(n_cells: Int64[Tensor, " V"], kind: str) -> None:
    if bool((n_cells == 0).any()):
        raise ValueError(
            f"vertex {int((n_cells == 0).nonzero()[0])} belongs to no {kind}; remove vertices that nothing uses"
        )


# Intersection of a surface with a plane.


def plane_section(mesh: Mesh, axis: int, position: float) -> Float[Tensor, "n 2 3"]:
    """The line segments in which the faces intersect the plane where coordinate ``axis`` equals ``position``.

    Exact up to rounding, with one segment, by its two ends, for each face that crosses the plane; there are no rows if
    the plane does not intersect the surface. A vertex on the plane counts as above it, so that a closed surface gives
    closed lines. A face that touches the plane only from above gives no segment; one that touches it from below with a
    corner gives a segment of length zero.

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


# Random or evenly spaced points on a mesh or contour.


def sample_points(shape: Mesh | Contour, n_points: int, generator: Generator) -> Float[Tensor, "n d"]:
    """Independent random points, uniform by area on a mesh or by length on a contour.

    A cell is drawn with probability proportional to its size, then a point uniformly in it. The points are
    differentiable with respect to the vertices, for fixed random numbers.

    Raises
    ------
    ValueError
        If ``n_points`` < 1, or the shape has zero area (or length).
    """
    cells, barycentric = sample_locations(shape, n_points, generator)
    corners = shape.vertices[(shape.edges if isinstance(shape, Contour) else shape.faces)[cells]]
    return (barycentric[:, :, None] * corners).sum(dim=1)


def sample_locations(
    shape: Mesh | Contour, n_points: int, generator: Generator
) -> tuple[Int64[Tensor, " n"], Float[Tensor, "n c"]]:
    """The cells and barycentric coordinates of a uniform random sample, see :func:`sample_points`."""
    require_positive_integer(n_points, "n_points")
    generator = numpy_generator(generator)
    with torch.no_grad():  # nothing of the whole shape is kept for a gradient
        sizes = edge_lengths(shape) if isinstance(shape, Contour) else face_areas(shape)
    cumulative = np.cumsum(sizes.double().cpu().numpy())
    if not cumulative[-1] > 0:
        raise ValueError(
            f"the total area or length is {cumulative[-1]:.3g}; only a shape of positive size can be sampled"
        )
    # The upper limit excludes empty cells at the end.
    cells = np.searchsorted(cumulative, generator.random(n_points) * cumulative[-1], side="right")
    cells = np.minimum(cells, np.searchsorted(cumulative, cumulative[-1], side="left"))
    if isinstance(shape, Contour):
        along = generator.random(n_points)
        barycentric = np.stack([1 - along, along], axis=1)
    else:
        root, other = np.sqrt(generator.random(n_points)), generator.random(n_points)
        barycentric = np.stack([1 - root, root * (1 - other), root * other], axis=1)
    vertices = shape.vertices
    return torch.from_numpy(cells).to(vertices.device), torch.from_numpy(barycentric).to(vertices)


def even_points(contour: Contour, n_points: int, offset: float = 0.5) -> Float[Tensor, "n 2"]:
    """Points at equal distances of arc length along the edges of a contour, in the order of the edges.

    The first point lies ``offset`` spacings from the start, in [0, 1).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, ``offset`` is outside [0, 1), or the contour has zero length.
    """
    require_positive_integer(n_points, "n_points")
    if not 0 <= offset < 1:
        raise ValueError(f"offset is {offset!r}; a number in [0, 1) is needed, in spacings")
    lengths = edge_lengths(contour).detach()
    cumulative = lengths.cumsum(0)
    if not float(cumulative[-1]) > 0:
        raise ValueError("the contour has no length; at least two vertices must differ")
    places = (torch.arange(n_points, dtype=lengths.dtype, device=lengths.device) + offset) * (cumulative[-1] / n_points)
    edges = torch.searchsorted(cumulative, places, right=True).clamp(max=len(lengths) - 1)
    along = (places - (cumulative[edges] - lengths[edges])) / lengths[edges]
    start, end = contour.vertices[contour.edges[edges]].unbind(dim=1)
    return start + along[:, None] * (end - start)


# Triangulation of faces with more than three corners.


def triangulate(vertices: Float[Tensor, "V 3"], polygons: Iterable[Iterable[int] | Int[Tensor, " c"]]) -> Mesh:
    """The mesh of polygonal faces, each divided into triangles. Area and measure stay the same.

    A polygon with n corners is divided into n − 2 triangles of the same orientation: a fan around its first corner if
    all triangles of the fan have the same orientation (always if the polygon is convex), otherwise by ear clipping. The
    corners should lie in one plane. For other polygons the surface is not unique, and this is one choice.

    Parameters
    ----------
    vertices : tensor or array
        Floating point, one row per vertex. The mesh is differentiable with respect to them.
    polygons : sequence of sequences of int, or array
        The vertex indices of every face, in order, at least three.

    Raises
    ------
    ValueError
        If a polygon has fewer than three corners, a repeated vertex, or intersects itself; otherwise as :class:`Mesh`.

    References
    ----------
    Meisters, *Polygons have ears*, 1975.

    Examples
    --------
    >>> import torch, meshot
    >>> square = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    >>> meshot.triangulate(square, [[0, 1, 2, 3]])
    Mesh(4 vertices, 2 faces, torch.float32)
    """
    vertices = as_points(vertices, "vertices", 3)
    places = vertices.detach().cpu().numpy().astype(np.float64)
    pieces = [_triangles(places, [int(corner) for corner in polygon], k) for k, polygon in enumerate(polygons)]
    faces = np.concatenate([np.empty((0, 3), np.int64), *pieces])
    return Mesh(vertices, torch.from_numpy(faces).to(vertices.device))


def _triangles(places: Float[Array, "V 3"], corners: list[int], k: int) -> Array:
    """The triangles of the ``k``-th polygon."""
    if len(corners) < 3 or len(set(corners)) < len(corners):
        raise ValueError(f"polygon {k} is {corners}; at least three corners are needed, each a vertex of its own")
    if min(corners) < 0 or max(corners) >= len(places):
        raise ValueError(f"polygon {k} is {corners}, but there are {len(places)} vertices: indices start at 0")
    fan = np.array([[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])])
    if len(fan) == 1:
        return fan
    # Coordinates in the plane normal to the polygon's area vector, in which the polygon runs counter-clockwise.
    centred = places[corners] - places[corners].mean(axis=0)
    area = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    _, _, axes = np.linalg.svd(area[None])
    first, second = axes[1], axes[2]
    flat = centred @ np.stack([first, second * np.sign(np.cross(first, second) @ area)], axis=1)
    if (_turns(flat[[0]], flat[1:-1], flat[2:]) >= 0).all():
        return fan
    # Ear clipping: an ear is a left turn whose triangle contains no other corner.
    rest, triangles = list(range(len(flat))), []
    while len(rest) > 3:
        ear = next((i for i in range(len(rest)) if _is_ear(flat, rest, i)), None)
        if ear is None:
            raise ValueError(f"polygon {k} crosses itself, so that it bounds no surface: split it where it crosses")
        triangles.append([rest[ear - 1], rest[ear], rest[(ear + 1) % len(rest)]])
        del rest[ear]
    if _turns(flat[rest[:1]], flat[rest[1:2]], flat[rest[2:]])[0] < 0:
        raise ValueError(f"polygon {k} crosses itself, so that it bounds no surface: split it where it crosses")
    return np.array(corners)[[*triangles, rest]]


def _turns(a: Float[Array, "n 2"], b: Float[Array, "m 2"], c: Float[Array, "m 2"]) -> Float[Array, " m"]:
    """Twice the signed area of triangles: positive if a → b → c turns left."""
    ab, ac = b - a, c - a
    return ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]


def _is_ear(flat: Float[Array, "c 2"], rest: list[int], i: int) -> bool:
    before, at, after = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
    a, b, c = flat[[before]], flat[[at]], flat[[after]]
    if _turns(a, b, c)[0] <= 0:
        return False
    others = flat[[r for r in rest if r not in (before, at, after)]]
    sides = [
        _turns(start, np.broadcast_to(stop, others.shape), others) >= 0 for start, stop in ((a, b), (b, c), (c, a))
    ]
    return not np.logical_and.reduce(sides).any()
