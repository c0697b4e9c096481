"""Errors of known kind and size that are added to a surface, to test metrics.

Bridges and intersections of sulcal walls are in ``meshot.synth.defects.sulcal_walls``.

The functions do not modify their input. Lengths are in units of the vertices, mm for a cortex.
"""

import torch

from meshot.errors import require_positive, require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.geometry import face_barycentres, vertex_normals
from meshot.rng import Generator, numpy_generator
from meshot.types import Bool, Float, Tensor


def shifted(mesh: Mesh, shift: tuple[float, float, float]) -> Mesh:
    """The surface translated by a vector, as after an inaccurate registration.

    The distance to the original is known: W₂ is the length of the vector, SW₂ this length over √3 (without sampling).
    """
    return mesh.with_vertices(mesh.vertices + mesh.vertices.new_tensor(shift))


def inflated(mesh: Mesh, distance: float) -> Mesh:
    """Every vertex moved along its normal, outwards if ``distance`` > 0, as by an inaccurate tissue threshold."""
    return mesh.with_vertices(mesh.vertices + distance * vertex_normals(mesh))


def noisy(mesh: Mesh, deviation: float, generator: Generator) -> Mesh:
    """Every vertex moved along its normal by an independent Gaussian distance.

    Parameters
    ----------
    mesh : Mesh
    deviation : float
        Standard deviation of the distances.
    generator : numpy.random.Generator, torch.Generator or int

    Raises
    ------
    ValueError
        If the deviation is not positive.
    """
    require_positive(deviation, "deviation", "units of the vertices")
    amounts = deviation * numpy_generator(generator).standard_normal(len(mesh.vertices))
    return mesh.with_vertices(mesh.vertices + mesh.vertices.new_tensor(amounts)[:, None] * vertex_normals(mesh))


def with_hole(mesh: Mesh, centre: Float[Tensor, " 3"], radius: float) -> Mesh:
    """The surface without the faces whose barycentre lies in a ball. The result is open.

    Raises
    ------
    ValueError
        If the radius is not positive, no face lies in the ball, or all do.
    """
    require_positive(radius, "radius", "units of the vertices")
    gone = _near(face_barycentres(mesh), centre, radius)
    if not bool(gone.any()) or bool(gone.all()):
        raise ValueError(
            f"{int(gone.sum())} of {len(gone)} faces lie within {radius:g} of the centre; some but not all are needed: "
            "change the radius, or move the centre onto the surface"
        )
    return _without_loose_vertices(mesh.vertices, mesh.faces[~gone])


def with_spike(mesh: Mesh, vertex: int, height: float) -> Mesh:
    """The surface with one vertex moved outwards along its normal (inwards if ``height`` < 0).

    Raises
    ------
    ValueError
        If there is no such vertex.
    """
    if not 0 <= vertex < len(mesh.vertices):
        raise ValueError(f"vertex is {vertex}; an index from 0 to {len(mesh.vertices) - 1} is needed")
    moved = mesh.vertices.clone()
    moved[vertex] += height * vertex_normals(mesh)[vertex]
    return mesh.with_vertices(moved)


def with_blurred_folds(mesh: Mesh, centre: Float[Tensor, " 3"], radius: float, n_steps: int) -> Mesh:
    """The surface with the folds in a ball smoothed, as if a gyrus or sulcus had been missed.

    Parameters
    ----------
    mesh : Mesh
    centre : tensor
    radius : float
        Vertices within it move. The displacement decreases to zero at the boundary of the ball.
    n_steps : int
        Number of steps of Laplacian smoothing.

    Raises
    ------
    ValueError
        If the radius is not positive, or ``n_steps`` is not a positive integer.
    """
    require_positive(radius, "radius", "units of the vertices")
    require_positive_integer(n_steps, "n_steps")
    away = (mesh.vertices - centre).norm(dim=1) / radius
    amount = (1 - away.square()).clamp(min=0).sqrt()[:, None]
    smooth = laplacian_smoothing(mesh, n_steps).vertices
    return mesh.with_vertices(mesh.vertices + amount * (smooth - mesh.vertices))


def unevenly_sampled(mesh: Mesh, inside: Bool[Tensor, " F"], n_rounds: int) -> Mesh:
    """The same surface with more triangles in one part: a change of the mesh without any error.

    Each chosen face is divided into three at its barycentre, ``n_rounds`` times. Neighbouring faces do not change and
    the mesh stays closed. The set of points of the surface does not change; the triangles become less regular.

    Raises
    ------
    ValueError
        If ``inside`` does not have one entry per face, or ``n_rounds`` is not a positive integer.
    """
    require_positive_integer(n_rounds, "n_rounds")
    if inside.shape != mesh.faces.shape[:1]:
        raise ValueError(f"inside has shape {tuple(inside.shape)}; one truth value for each of {len(mesh.faces)} faces")
    vertices, cut, kept = mesh.vertices, mesh.faces[inside], mesh.faces[~inside]
    for _ in range(n_rounds):
        middle = torch.arange(len(vertices), len(vertices) + len(cut), device=cut.device)
        vertices = torch.cat([vertices, vertices[cut].mean(dim=1)])
        a, b, c = cut.T
        cut = torch.cat([torch.stack(part, dim=1) for part in ((a, b, middle), (b, c, middle), (c, a, middle))])
    return Mesh(vertices, torch.cat([kept, cut]))


def with_flipped_faces(mesh: Mesh, share: float, generator: Generator) -> Mesh:
    """The surface with randomly chosen faces reversed: the same positions, inconsistent orientation.

    Parameters
    ----------
    mesh : Mesh
    share : float
        Fraction of the faces, in (0, 1]. With 1 the whole surface is inside out.
    generator : numpy.random.Generator, torch.Generator or int

    Raises
    ------
    ValueError
        If ``share`` is not in (0, 1].
    """
    if not 0 < share <= 1:
        raise ValueError(f"share is {share!r}; a number in (0, 1] is needed, the part of the faces that is turned")
    n_turned = max(1, round(share * len(mesh.faces)))
    chosen = numpy_generator(generator).permutation(len(mesh.faces))[:n_turned]
    faces = mesh.faces.clone()
    faces[chosen] = faces[chosen].flip(1)
    return Mesh(mesh.vertices, faces)


def _near(points: Float[Tensor, "n 3"], centre: Float[Tensor, " 3"], radius: float) -> Bool[Tensor, " n"]:
    return (points - centre).norm(dim=1) <= radius


def _without_loose_vertices(vertices: Tensor, faces: Tensor) -> Mesh:
    used, index = torch.unique(faces, return_inverse=True)
    return Mesh(vertices[used], index)
