"""Example surfaces and contours with known area, volume or distance.

Spheres, ellipsoids, cubes, a folded sphere; circles, polygons, stars and the letter E. The book uses them as examples,
and the tests compare results with their closed forms.
"""

import itertools
import math

import numpy as np
import torch

from meshot.errors import require_finite, require_positive, require_positive_integer, require_shape
from meshot.mesh.geometry import signed_volume
from meshot.mesh.mesh import Contour, Mesh, closed_contour
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Int64, Tensor

# Closed example surfaces with known area or volume and with outward normals.


def icosphere(
    subdivisions: int,
    radius: float = 1.0,
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
    dtype: torch.dtype = torch.float64,
) -> Mesh:
    """A sphere: an icosahedron whose faces are divided into four ``subdivisions`` times, with 20 · 4ˢ faces.

    Parameters
    ----------
    subdivisions : int
        At least 0 (the icosahedron). There are 10 · 4ˢ + 2 vertices.
    radius : float
        All vertices lie on the sphere, so that area and volume are below those of the sphere, by O(h²).
    centre : three floats
    dtype : torch.dtype
        Dtype of the vertices.

    Raises
    ------
    ValueError
        If ``subdivisions`` is not an integer in [0, 9], or ``radius`` is not positive.
    """
    if isinstance(subdivisions, bool) or not isinstance(subdivisions, int) or not 0 <= subdivisions <= 9:
        raise ValueError(
            f"subdivisions is {subdivisions!r}; an integer from 0 to 9 is needed (9 gives 5 million faces)"
        )
    require_positive(radius, "radius", "units of the vertices")
    # The icosahedron.
    golden = (1 + math.sqrt(5)) / 2
    flat = [(a, b * golden) for a, b in itertools.product((-1.0, 1.0), repeat=2)]
    corners = [(0.0, *p) for p in flat] + [(*p, 0.0) for p in flat] + [(p[1], 0.0, p[0]) for p in flat]
    points = torch.tensor(corners, dtype=torch.float64)
    points = points / torch.linalg.vector_norm(points, dim=1, keepdim=True)
    near = torch.cdist(points, points) < 1.1  # the edge is 1.05 for radius one, the next distance 1.70
    threes = itertools.combinations(range(12), 3)
    threes = [f for f in threes if all(near[pair] for pair in itertools.combinations(f, 2))]
    # Three corners are counter-clockwise seen from outside if their determinant is positive.
    faces = torch.tensor([f if torch.det(points[list(f)]) > 0 else (f[0], f[2], f[1]) for f in threes])
    for _ in range(subdivisions):
        points, faces = split_in_four(points, faces)
        points = points / torch.linalg.vector_norm(points, dim=1, keepdim=True)
    shift = torch.tensor(centre, dtype=torch.float64)
    return Mesh((radius * points + shift).to(dtype), faces)


def ellipsoid(subdivisions: int, radii: tuple[float, float, float], dtype: torch.dtype = torch.float64) -> Mesh:
    """An icosphere stretched along the axes, centred at the origin, with half-axes ``radii`` along x, y and z.

    Raises
    ------
    ValueError
        If a radius is not positive.
    """
    for axis, radius in zip("xyz", radii, strict=True):
        require_positive(radius, f"the radius along {axis}", "units of the vertices")
    sphere = icosphere(subdivisions)
    return sphere.with_vertices(sphere.vertices * torch.tensor(radii, dtype=torch.float64)).to(dtype)


def folded_sphere(
    subdivisions: int, radius: float = 40.0, depth: float = 6.0, n_folds: int = 5, dtype: torch.dtype = torch.float64
) -> Mesh:
    """A star-shaped surface with gyri and sulci: an icosphere whose radius depends on the direction.

    The distance from the origin along the unit vector u is ``radius`` + ``depth`` · s(u), with
    s(u) = ⅓ Σ sin(n x + cos(n y)) over cyclic (x, y, z), which lies in [−1, 1]. The surface is a radial graph, so it
    does not intersect itself, and the deformation from the sphere is known at every vertex.

    Parameters
    ----------
    subdivisions : int
        As :func:`icosphere`.
    radius, depth : float
        Radius of the sphere and amplitude of the folds, in mm; ``depth`` is below ``radius``.
    n_folds : int
        The frequency n. There are about n / 4 folds along a quarter of a circle.
    dtype : torch.dtype

    Raises
    ------
    ValueError
        If ``depth`` is not in [0, radius), or ``radius`` is not positive.
    """
    require_positive(radius, "radius", "units of the vertices")
    if not 0 <= depth < radius:
        raise ValueError(
            f"depth is {depth!r}; it must be in [0, radius) = [0, {radius:g}) for the surface to be a graph"
        )
    sphere = icosphere(subdivisions)
    phase = n_folds * sphere.vertices
    profile = torch.sin(phase + torch.cos(phase.roll(-1, dims=1))).mean(dim=1)
    return sphere.with_vertices((radius + depth * profile)[:, None] * sphere.vertices).to(dtype)


def cube(side: float = 1.0, dtype: torch.dtype = torch.float64) -> Mesh:
    """The surface of a cube centred at the origin: 8 vertices, 12 triangles.

    Raises
    ------
    ValueError
        If ``side`` is not positive.
    """
    require_positive(side, "side", "units of the vertices")
    corners = torch.tensor(list(itertools.product((-0.5, 0.5), repeat=3)), dtype=dtype)  # index = 4x + 2y + z
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[a, b, c] for a, b, c, _ in squares] + [[a, c, d] for a, _, c, d in squares]
    return Mesh(side * corners, torch.tensor(faces))


def tetrahedron(corners: Float[Tensor, "4 3"] | None = None) -> Mesh:
    """The surface of a tetrahedron. Faces are oriented outwards for any order of the four corners.

    By default these are every other corner of the cube [−1, 1]³, of a regular tetrahedron.

    Raises
    ------
    ValueError
        If there are not four points in R³, or they lie in one plane.
    """
    if corners is None:
        corners = torch.tensor([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=torch.float64)
    require_shape(corners, "corners", 3)
    require_finite(corners, "corners")
    if len(corners) != 4:
        raise ValueError(f"corners has {len(corners)} rows; a tetrahedron has 4")
    mesh = Mesh(corners, torch.tensor([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]))
    volume = float(signed_volume(mesh).detach())
    if abs(volume) <= 1e-12 * float(torch.linalg.vector_norm((corners - corners[0]).detach(), dim=1).max()) ** 3:
        raise ValueError("the four corners lie in one plane; a tetrahedron needs a volume: move one of them")
    return mesh if volume > 0 else Mesh(corners, mesh.faces.flip(1))


def split_in_four(
    points: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"]
) -> tuple[Float[Tensor, "W 3"], Int64[Tensor, "G 3"]]:
    """Every triangle divided into four at its edge midpoints, which neighbours share. Orientation stays the same."""
    n_points, n_faces = len(points), len(faces)
    halves = torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).sort(dim=1).values
    keys, which = torch.unique(halves[:, 0] * n_points + halves[:, 1], return_inverse=True)
    midpoints = (points[keys // n_points] + points[keys % n_points]) / 2
    ab, bc, ca = (n_points + which).view(3, n_faces)
    a, b, c = faces.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return torch.cat([points, midpoints]), torch.cat([torch.stack(part, dim=1) for part in parts])


# Closed contours with known lengths, used in the 2D experiments of the book.


def regular_polygon(n_corners: int, radius: float = 1.0) -> Contour:
    """A polygon with equal sides and angles, counter-clockwise, with its first corner directly above the origin.

    Every corner is at the distance ``radius`` from the origin; the perimeter is 2 · n_corners · radius ·
    sin(π / n_corners).

    Raises
    ------
    ValueError
        If there are fewer than three corners, or the radius is not positive.
    """
    _require_corners(n_corners, "n_corners", 3)
    require_positive(radius, "radius", "units of the vertices")
    return closed_contour(_polar(np.full(n_corners, radius), _even_angles(n_corners)))


def circle(radius: float = 1.0, n_corners: int = 720) -> Contour:
    """A circle, approximated by a regular polygon. With 720 corners it is shorter by the factor 1 − 3 · 10⁻⁶."""
    return regular_polygon(n_corners, radius)


def star(n_tips: int, outer_radius: float = 1.0, inner_radius: float = 0.4) -> Contour:
    """A star with ``n_tips`` equal tips and corners alternately on two circles. The first tip is above the origin.

    Parameters
    ----------
    n_tips : int
        At least two.
    outer_radius, inner_radius : float
        Radius of the tips, and of the corners between them. A smaller inner radius gives sharper tips.

    Raises
    ------
    ValueError
        If there are fewer than two tips, or 0 < ``inner_radius`` < ``outer_radius`` does not hold.
    """
    _require_corners(n_tips, "n_tips", 2)
    if not 0 < inner_radius < outer_radius:
        raise ValueError(
            f"inner_radius is {inner_radius!r} and outer_radius {outer_radius!r}; 0 < inner_radius < outer_radius is "
            "needed: swap them, or use regular_polygon where they are equal"
        )
    return closed_contour(_polar(np.tile([outer_radius, inner_radius], n_tips), _even_angles(2 * n_tips)))


def near_regular_polygon(n_corners: int, jitter: float, generator: Generator, radius: float = 1.0) -> Contour:
    """A regular polygon whose corners are moved radially by random amounts up to ``jitter`` · ``radius``.

    Parameters
    ----------
    n_corners : int
        At least three.
    jitter : float
        In [0, 1): each corner's distance from the origin is uniform in ``radius`` · [1 − jitter, 1 + jitter].
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    radius : float
        Of the regular polygon.

    Raises
    ------
    ValueError
        If there are fewer than three corners, the radius is not positive, or ``jitter`` is outside [0, 1).
    """
    _require_corners(n_corners, "n_corners", 3)
    if not 0 <= jitter < 1:
        raise ValueError(f"jitter is {jitter!r}; a number in [0, 1) is needed, as a share of the radius")
    require_positive(radius, "radius", "units of the vertices")
    radii = radius * (1 + jitter * numpy_generator(generator).uniform(-1, 1, n_corners))
    return closed_contour(_polar(radii, _even_angles(n_corners)))


def letter_e(width: float = 1.4, height: float = 2.0, stroke: float = 0.3) -> Contour:
    """The outline of a capital E with three bars of equal thickness, centred on the origin. Not convex, twelve corners.

    Parameters
    ----------
    width, height : float
        Size of the bounding box. The perimeter is 2 · height + 6 · width − 4 · stroke.
    stroke : float
        Thickness of the stem and of the bars, less than a third of the height and less than the width.

    Raises
    ------
    ValueError
        If the bars would touch, or a length is not positive.
    """
    if not (0 < stroke < width and 3 * stroke < height):
        raise ValueError(
            f"width is {width!r}, height {height!r}, stroke {stroke!r}; 0 < stroke < width and 3 stroke < height are "
            "needed, so that there is room between the bars"
        )
    right, top, stem, half = width / 2, height / 2, stroke - width / 2, stroke / 2
    outline = [
        (-right, -top),
        (right, -top),
        (right, stroke - top),
        (stem, stroke - top),
        (stem, -half),
        (right, -half),
    ]
    mirrored = [(x, -y) for x, y in reversed(outline)]
    return closed_contour(torch.tensor(outline + mirrored, dtype=torch.float64))


def _even_angles(n_corners: int) -> np.ndarray:
    return math.pi / 2 + 2 * math.pi * np.arange(n_corners) / n_corners


def _polar(radii: np.ndarray, angles: np.ndarray) -> Float[Tensor, "n 2"]:
    return torch.from_numpy(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1))


def _require_corners(count: int, name: str, least: int) -> None:
    require_positive_integer(count, name)
    if count < least:
        raise ValueError(f"{name} is {count}; at least {least} are needed to enclose an area")
