"""Chapter 10: weights of faces, the tent of a triangle, a scale for the normals, surfaces turned inside out."""

from collections.abc import Callable

import numpy as np
import torch

from meshot.mesh import Mesh
from meshot.mesh.geometry import face_areas, face_barycentres, face_normals, signed_volume
from meshot.mesh.shapes import cube, folded_sphere, icosphere, tetrahedron
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer

Loss = Callable[[float], float]


def face_weights(function: object) -> None:
    """Check ``function(vertices, faces)``: the probability of every face under the uniform law on the surface."""
    mistakes = [
        Mistake(
            lambda v, f: torch.full((len(f),), 1 / len(f), dtype=v.dtype),
            "every face has the same mass: a large one should be hit more often than a small one",
        ),
        Mistake(lambda v, f: _areas(v, f), "these are the areas; a probability measure has total mass one"),
        Mistake(
            lambda v, f: 2 * _areas(v, f), "these are the norms of the cross products: halve, then make them sum to one"
        ),
        Mistake(
            lambda v, f: _areas(v, f) ** 2 / (_areas(v, f) ** 2).sum(), "the squares of the areas: the root is missing"
        ),
        Mistake(
            lambda v, f: _areas(v, f) / _areas(v, f).max(),
            "divided by the largest area: the weights must sum to one instead",
        ),
    ]
    folded, box = folded_sphere(1, 1.0, 0.4), cube(2.0)
    stretched = box.vertices * torch.tensor([1.0, 3.0, 0.5], dtype=torch.float64)
    empty = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], dtype=torch.float64)
    cases = [
        Case("a tetrahedron", (tetrahedron().vertices, tetrahedron().faces)),
        Case("a box with unequal sides", (stretched, box.faces)),
        Case("a folded surface", (folded.vertices, folded.faces)),
        Case("a face without area", (empty, torch.tensor([[0, 1, 2], [0, 1, 3]]))),
    ]
    check_answer(function, lambda v, f: _areas(v, f) / _areas(v, f).sum(), cases, mistakes, "face_weights")


def _areas(vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"]) -> Float[Tensor, " F"]:
    return face_areas(Mesh(vertices, faces))


def tent_density(function: object) -> None:
    """Check ``function(corners, x)``: the density of a uniform triangle, its corners projected, at every x."""
    mistakes = [
        Mistake(lambda c, x: _tent(c, x) / 2, "the area under it is one half: how high must a tent of that base be?"),
        Mistake(
            lambda c, x: _tent(torch.stack([c.min(), (c.min() + c.max()) / 2, c.max()]), x),
            "the peak is in the middle of the base; it belongs over the middle corner",
        ),
        Mistake(lambda c, x: _tent(c, x, ordered=False), "the corners come in any order: sort them first"),
        Mistake(
            lambda c, x: ((x >= c.min()) & (x <= c.max())).double() / (c.max() - c.min()),
            "this is the law of an edge, a box; the sections of a triangle grow and shrink",
        ),
        Mistake(lambda c, x: _tent(c, x, cut=False), "outside the triangle the density is zero, not a falling line"),
    ]
    generator = np.random.default_rng(0)
    corners = torch.tensor([0.3, 2.0, -1.0], dtype=torch.float64)
    inside = torch.linspace(-0.97, 1.93, 7, dtype=torch.float64)
    beyond = torch.tensor([-3.0, -1.2, 0.25, 2.2, 9.0], dtype=torch.float64)
    random = torch.from_numpy(generator.normal(size=3))
    cases = [
        Case("three different numbers", (corners, inside)),
        Case("sorted corners", (corners.sort().values, inside)),
        Case("places outside the triangle", (corners, beyond)),
        Case("random corners", (random, torch.from_numpy(generator.normal(size=9)))),
        Case(
            "two corners at the left end",
            (torch.tensor([0.0, 0.0, 3.0]).double(), torch.tensor([-1.0, 0.0, 0.5, 2.0]).double()),
        ),
        Case(
            "two corners at the right end",
            (torch.tensor([1.0, 4.0, 4.0]).double(), torch.tensor([0.5, 2.0, 3.5, 4.0, 5.0]).double()),
        ),
    ]
    check_answer(function, _tent, cases, mistakes, "tent_density")


def _tent(
    corners: Float[Tensor, " 3"], x: Float[Tensor, " k"], ordered: bool = True, cut: bool = True
) -> Float[Tensor, " k"]:
    low, middle, high = corners.sort().values if ordered else corners
    rising = (x - low) / (middle - low) if middle != low else torch.full_like(x, torch.inf)
    falling = (high - x) / (high - middle) if high != middle else torch.full_like(x, torch.inf)
    heights = torch.minimum(rising, falling) * 2 / (high - low)
    inside = (x >= low) & (x <= high)
    return torch.where(inside, heights, torch.zeros_like(heights)) if cut else heights


def scale_for_share(function: object) -> None:
    """Check ``function(loss, share)``: the normal scale s with 1 − loss(0)/loss(s) = share."""
    mistakes = [
        Mistake(
            lambda loss, share: _solved(lambda s: loss(s) / loss(0) - 1, share),
            "this compares what normals add with the loss *without* them; the share is of the whole, loss(s)",
        ),
        Mistake(
            lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), 1 - share),
            "this leaves that share to the positions; turn it round",
        ),
        Mistake(
            lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), share) ** 2,
            "this is the square of the scale",
        ),
        Mistake(
            lambda loss, share: (loss(0) * share / ((1 - share) * (loss(1) - loss(0)))) ** 0.5,
            "this supposes that normals add a multiple of s²; that ends where turning costs more than moving: search",
        ),
        Mistake(
            lambda loss, share: _solved(lambda s: 1 - loss(0) / loss(s), share, highest=100.0),
            "the search stops at a scale of 100; scales may be of any size: double the upper end until it is enough",
        ),
    ]
    cases = [
        Case("positions 2, normals s², a tenth", (_quadratic(2.0, 1.0), 0.1)),
        Case("positions 0.3, normals 4 s², a half", (_quadratic(0.3, 4.0), 0.5)),
        Case("normals that saturate at large scales", (_saturating(1.0, 30.0, 0.5), 0.6)),
        Case("lengths in metres", (_saturating(1e-6, 2.0, 1e-3), 0.25)),
        Case("lengths in micrometres", (_quadratic(4e8, 1.0), 0.2)),
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


def _solved(rising: Callable[[float], float], wanted: float, highest: float = 1e9) -> float:
    low, high = 1e-9, highest
    for _ in range(200):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return high


def is_inside_out(function: object) -> None:
    """Check ``function(vertices, faces)``: do the normals of a closed surface point inwards?"""
    mistakes = [
        Mistake(lambda v, f: not _inside_out(v, f), "the other way round: outward normals are the right ones"),
        Mistake(
            lambda v, f: bool((_radial(v, f)).mean() < 0),
            "faces count alike here; weight each with its area, or a finely cut corner outvotes the rest",
        ),
        Mistake(
            lambda v, f: bool(_radial(v, f)[0] < 0),
            "one face decides here; on a folded surface some faces of a right surface look back at the middle",
        ),
        Mistake(
            lambda v, f: bool((_radial(v, f, centred=False) * _areas(v, f)).min() < 0),
            "some faces of a right surface look back at the origin; only the sum over all of them tells",
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
