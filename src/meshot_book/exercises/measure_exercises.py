"""Chapter 10: weights of faces, the tent of a triangle, and the mean square of a projected surface."""

import numpy as np
import torch

from meshot.mesh import Mesh, cube, face_areas, folded_sphere, tetrahedron
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def face_weights(function: object) -> None:
    """Check ``function(vertices, faces)``: the probability of every face under the uniform law on the surface."""
    mistakes = [
        Mistake(
            lambda v, f: torch.full((len(f),), 1 / len(f), dtype=v.dtype),
            "every face has the same mass: the mass must be proportional to the area",
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
        Mistake(
            lambda c, x: _tent(c, x) / 2, "the area under the density is one half instead of one: double the height"
        ),
        Mistake(
            lambda c, x: _tent(torch.stack([c.min(), (c.min() + c.max()) / 2, c.max()]), x),
            "the peak is in the middle of the base; it must be at the middle corner",
        ),
        Mistake(lambda c, x: _tent(c, x, ordered=False), "the corners come in any order: sort them first"),
        Mistake(
            lambda c, x: ((x >= c.min()) & (x <= c.max())).double() / (c.max() - c.min()),
            "this is the constant density of an edge; that of a triangle rises and falls linearly",
        ),
        Mistake(
            lambda c, x: _tent(c, x, cut=False), "outside the triangle the density is zero; do not extend the lines"
        ),
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


def mean_square(function: object) -> None:
    """Check ``function(vertices, faces, direction)``: the mean of ⟨θ, x⟩² under the uniform distribution on a mesh."""
    mistakes = [
        Mistake(
            lambda v, f, u: _mean(v, f, (v[f] @ u).mean(dim=1) ** 2),
            "barycentres only: within a face the projection varies, and that adds to the mean square",
        ),
        Mistake(
            lambda v, f, u: _mean(v, f, (v[f] @ u).square().mean(dim=1)),
            "corners only: this gives too much weight to points far from the middle",
        ),
        Mistake(
            lambda v, f, u: float(_squares(v, f, u).mean()),
            "every face has the same weight: weight each by its area",
        ),
        Mistake(
            lambda v, f, u: float((_areas(v, f) * _squares(v, f, u)).sum()),
            "this is the integral; divide by the total area",
        ),
        Mistake(
            lambda v, f, u: _mean(v, f, _squares(v, f, u)) ** 0.5,
            "this is a root; the mean square is asked for",
        ),
        Mistake(
            lambda v, f, u: _mean(v, f, _squares(v, f, u)) - _mean(v, f, (v[f] @ u).mean(dim=1)) ** 2,
            "this is the variance; do not subtract the square of the mean",
        ),
        Mistake(
            lambda v, f, u: float((v @ u).square().mean()),
            "this is a mean over the vertices; a surface has its mass on its faces",
        ),
    ]
    check_answer(function, lambda v, f, u: _mean(v, f, _squares(v, f, u)), _mesh_cases(), mistakes, "mean_square")


def _mesh_cases() -> list[Case]:
    generator = np.random.default_rng(0)
    oblique = torch.tensor([0.36, 0.48, 0.8], dtype=torch.float64)
    folded, box = folded_sphere(1, 1.0, 0.4), cube(2.0)
    shifted = box.vertices * torch.tensor([1.0, 3.0, 0.5], dtype=torch.float64) + 1.0
    one = torch.from_numpy(generator.normal(size=(3, 3)))
    return [
        Case("one triangle", (one, torch.tensor([[0, 1, 2]]), oblique)),
        Case("a shifted box with unequal sides", (shifted, box.faces, oblique)),
        Case("a folded surface", (folded.vertices, folded.faces, oblique)),
        Case("a face seen edge-on", (one, torch.tensor([[0, 1, 2]]), _normal(one))),
    ]


def _normal(corners: Float[Tensor, "3 3"]) -> Float[Tensor, " 3"]:
    normal = torch.linalg.cross(corners[1] - corners[0], corners[2] - corners[0])
    return normal / normal.norm()


def _squares(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"], u: Float[Tensor, " 3"]) -> Float[Tensor, " F"]:
    """The mean of the squared projection over each face: (|a|² + |b|² + |c|² + (a + b + c)²) / 12."""
    corners = v[f] @ u
    return (corners.square().sum(dim=1) + corners.sum(dim=1).square()) / 12


def _mean(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"], values: Float[Tensor, " F"]) -> float:
    areas = _areas(v, f)
    return float((areas * values).sum() / areas.sum())
