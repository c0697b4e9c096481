"""Chapter 14: a length for the normals, the gradient of an area, and surfaces turned inside out."""

from collections.abc import Callable

import numpy as np
import torch

from meshot.mesh import Mesh, cube, face_areas, face_barycentres, face_normals, folded_sphere, icosphere, signed_volume
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer

Loss = Callable[[float], float]


def scale_for_share(function: object) -> None:
    """Check ``function(loss, share)``: the normal scale s with 1 − loss(0)/loss(s) = share."""
    mistakes = [
        Mistake(
            lambda loss, share: _solved(lambda s: loss(s) / loss(0) - 1, share),
            "this compares what normals add with the loss *without* them; the share is of the whole, loss(s)",
        ),
        Mistake(
            lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), 1 - share),
            "this is the scale at which the positions have that share, not the normals",
        ),
        Mistake(
            lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), share) ** 2,
            "this is the square of the scale",
        ),
        Mistake(
            lambda loss, share: (loss(0) * share / ((1 - share) * (loss(1) - loss(0)))) ** 0.5,
            "this assumes that normals add a multiple of s², which holds for small s only: search numerically",
        ),
        Mistake(
            lambda loss, share: _bracketed(lambda s: 1 - loss(0) / loss(s), share, 100.0),
            "scales may have any size, and this search ends at 100: widen the interval until it contains the solution",
        ),
    ]
    cases = [
        Case("positions 2, normals s², a tenth", (_quadratic(2.0, 1.0), 0.1)),
        Case("positions 0.3, normals 4 s², a half", (_quadratic(0.3, 4.0), 0.5)),
        Case("normals that saturate at large scales", (_saturating(1.0, 30.0, 0.5), 0.6)),
        Case("lengths in metres", (_saturating(1e-6, 2.0, 1e-3), 0.25)),
        Case("lengths in micrometres", (_saturating(4e6, 1.0, 1e5), 0.2)),
    ]
    check_answer(
        function,
        lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), share),
        cases,
        mistakes,
        "scale_for_share",
    )


def _quadratic(places: float, normals: float) -> Loss:
    return lambda s: places + normals * s * s


def _saturating(places: float, normals: float, scale: float) -> Loss:
    return lambda s: places + normals * s * s / (1 + (s / scale) ** 2)


def _solved(rising: Callable[[float], float], wanted: float) -> float:
    low, high = 1e-9, 1e9
    for _ in range(200):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high


def _bracketed(rising: Callable[[float], float], wanted: float, high: float) -> float:
    low = 0.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high


def area_gradient(function: object) -> None:
    """Check ``function(a, b, c)``: the gradient of the area of a triangle in its corner a."""
    mistakes = [
        Mistake(
            lambda a, b, c: -_gradient(a, b, c),
            "the sign is wrong: the area grows when a moves away from the opposite edge",
        ),
        Mistake(lambda a, b, c: 2 * _gradient(a, b, c), "the area is half of base times height: a factor of two"),
        Mistake(
            lambda a, b, c: _gradient(a, b, c) / _gradient(a, b, c).norm(),
            "the direction is right; the length must be half that of the opposite edge",
        ),
        Mistake(
            lambda a, b, c: (c - b).norm() * (a - (b + c) / 2) / (a - (b + c) / 2).norm() / 2,
            "this points away from the middle of the opposite edge; the gradient is perpendicular to the edge",
        ),
        Mistake(lambda a, b, c: _gradient(b, c, a), "this is the gradient in b"),
        Mistake(lambda a, b, c: _gradient(c, a, b), "this is the gradient in c"),
        Mistake(
            lambda a, b, c: torch.linalg.cross(b - a, c - a) / 2,
            "this is the area vector, which is perpendicular to the triangle; the gradient lies in its plane",
        ),
    ]
    generator = np.random.default_rng(0)
    flat = torch.tensor([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], dtype=torch.float64)
    cases = [Case("a right triangle", tuple(flat)), Case("the same, clockwise", (flat[0], flat[2], flat[1]))]
    for name in ("a random triangle", "another random triangle"):
        cases.append(Case(name, tuple(torch.from_numpy(generator.normal(size=(3, 3))))))
    check_answer(function, _gradient, cases, mistakes, "area_gradient")


def _gradient(a: Float[Tensor, " 3"], b: Float[Tensor, " 3"], c: Float[Tensor, " 3"]) -> Float[Tensor, " 3"]:
    edge = c - b
    height = a - b - ((a - b) @ edge) / (edge @ edge) * edge
    return height / height.norm() * edge.norm() / 2


def is_inside_out(function: object) -> None:
    """Check ``function(vertices, faces)``: do the normals of a closed surface point inwards?"""
    mistakes = [
        Mistake(lambda v, f: not _inside_out(v, f), "the answer is negated: outward normals are the correct ones"),
        Mistake(
            lambda v, f: bool((_radial(v, f)).mean() < 0),
            "faces have equal weights here; weight each by its area, or finely divided regions count too much",
        ),
        Mistake(
            lambda v, f: bool(_radial(v, f)[0] < 0),
            "this uses one face only; on a folded surface some outward normals point towards the middle",
        ),
        Mistake(
            lambda v, f: bool((_radial(v, f, centred=False) * face_areas(Mesh(v, f))).min() < 0),
            "some outward normals point towards the origin; only the sum over all faces decides",
        ),
    ]
    sphere, folded, block, other = (
        icosphere(1),
        folded_sphere(2, 1.0, 0.6, 6),
        _notched_block(True),
        _notched_block(False),
    )
    far = sphere.vertices + torch.tensor([5.0, -3.0, 2.0], dtype=torch.float64)
    cases = [
        Case("a sphere", (sphere.vertices, sphere.faces)),
        Case("a sphere turned inside out", (sphere.vertices, sphere.faces.flip(1))),
        Case("a sphere far from the origin", (far, sphere.faces)),
        Case("the same, inside out", (far, sphere.faces.flip(1))),
        Case("a folded surface", (folded.vertices, folded.faces)),
        Case("a block with a funnel of many small faces", (block.vertices, block.faces)),
        Case("the same, inside out", (block.vertices, block.faces.flip(1))),
        Case("the same, its faces in another order", (other.vertices, other.faces)),
    ]
    check_answer(function, _inside_out, cases, mistakes, "is_inside_out")


def _inside_out(vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"]) -> bool:
    return bool(signed_volume(Mesh(vertices, faces)) < 0)


def _radial(vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"], centred: bool = True) -> Float[Tensor, " F"]:
    """⟨barycentre, normal⟩ of every face, from the mean of the vertices."""
    mesh = Mesh(vertices - vertices.mean(dim=0) if centred else vertices, faces)
    return (face_barycentres(mesh) * face_normals(mesh)).sum(dim=1)


def _notched_block(walls_first: bool) -> Mesh:
    """A cube whose top is a deep funnel, cut into many rings of small faces."""
    vertices, faces = cube(2.0).vertices, cube(2.0).faces
    top = (vertices[:, 2] == 1).nonzero().flatten()
    rim = vertices[top[[0, 2, 3, 1]]]  # counter-clockwise from above
    tip = torch.tensor([0.0, 0.0, -0.9], dtype=torch.float64)
    shrunk = 0.75 ** torch.arange(1, 13, dtype=torch.float64)
    rings = tip + shrunk[:, None, None] * (rim - tip)
    points = torch.cat([vertices, rings.reshape(-1, 3), tip[None]])
    names = torch.cat([top[[0, 2, 3, 1]][None], 8 + torch.arange(4 * len(shrunk)).view(-1, 4)])
    outer, inner = names[:-1], names[1:]
    walls = [(outer, outer.roll(-1, 1), inner), (outer.roll(-1, 1), inner.roll(-1, 1), inner)]
    last = torch.full_like(names[-1], len(points) - 1)
    walls.append((names[-1], names[-1].roll(-1), last))
    cut = torch.cat([torch.stack([side.reshape(-1) for side in wall], dim=1) for wall in walls])
    rest = faces[~(vertices[faces][..., 2] == 1).all(dim=1)]
    return Mesh(points, torch.cat([cut, rest] if walls_first else [rest, cut]))
