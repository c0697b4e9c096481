"""The exercises of chapter 21: how even triangles are, how many steps are safe, who is ahead after equal seconds."""

import math

import torch

from meshot.mesh import Mesh, folded_sphere, icosphere
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer

Curves = tuple[Tensor, Tensor, Tensor, Tensor]


def edge_variation(function: object) -> None:
    """Check ``function(vertices, faces)``: standard deviation over mean of the edge lengths, every edge once."""
    mistakes = [
        Mistake(
            lambda v, f: _variation(_lengths(v, _sides(f))),
            "edges between two faces are counted twice, edges at the boundary once; count every edge once",
        ),
        Mistake(
            lambda v, f: _variation(_lengths(v, _edges(f)), unbiased=True),
            "divide by the number of edges n, not by n − 1: the edges are all known, not a sample",
        ),
        Mistake(
            lambda v, f: _lengths(v, _edges(f)).std(unbiased=False),
            "that is the standard deviation, a length; divide by the mean, so that the size of the mesh cancels",
        ),
        Mistake(
            lambda v, f: _variation(_lengths(v, _edges(f))) ** 2, "that is the square; take the root of the variance"
        ),
        Mistake(
            lambda v, f: _variation(_lengths(v, _edges(f)).square()),
            "these are the squared lengths; take roots first",
        ),
    ]
    cases = [
        Case("a folded sphere", _arrays(folded_sphere(1))),
        Case("the same, ten times as large", _arrays(folded_sphere(1, 400.0, 60.0))),
        Case("an icosahedron, all edges equal", _arrays(icosphere(0))),
        Case("a single triangle with sides 3, 4, 5", _triangles([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])),
        Case(
            "an open strip",
            _triangles([[0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 3, 1], [0, 5, 0]], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        ),
    ]
    check_answer(function, lambda v, f: _variation(_lengths(v, _edges(f))), cases, mistakes, "edge_variation")


def _arrays(mesh: Mesh) -> tuple[Tensor, Tensor]:
    return mesh.vertices, mesh.faces


def _triangles(vertices: list[list[float]], faces: list[list[int]]) -> tuple[Tensor, Tensor]:
    return torch.tensor(vertices, dtype=torch.float64), torch.tensor(faces)


def _sides(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "S 2"]:
    return torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _edges(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "E 2"]:
    return torch.unique(_sides(faces).sort(dim=1).values, dim=0)


def _lengths(vertices: Float[Tensor, "V 3"], edges: Int64[Tensor, "E 2"]) -> Float[Tensor, " E"]:
    return (vertices[edges[:, 0]] - vertices[edges[:, 1]]).norm(dim=1)


def _variation(sizes: Float[Tensor, " n"], unbiased: bool = False) -> Float[Tensor, ""]:
    return sizes.std(unbiased=unbiased) / sizes.mean()


def safe_steps(function: object) -> None:
    """Check ``function(norms)``: the fewest equal Euler steps on [0, 1] with h·Lip < 1, from local constants."""
    mistakes = [
        Mistake(
            lambda norms: math.floor(norms.mean()) + 1,
            "this uses the average of the constants; every step must be safe for the largest one",
        ),
        Mistake(
            lambda norms: math.floor(norms[0].max()) + 1,
            "this uses the first time only; the constant may be larger later",
        ),
        Mistake(
            lambda norms: max(1, math.ceil(norms.max())),
            "h·Lip < 1 is strict: if the largest constant is a whole number, one more step is needed",
        ),
        Mistake(lambda norms: math.floor(norms.max()), "that is one too few: h·Lip is still above one"),
        Mistake(lambda norms: norms.max() + 1, "a number of steps is whole"),
        Mistake(
            lambda norms: math.floor(norms.max() * len(norms)) + 1,
            "the constants are per unit of time already; how many steps were taken to measure them does not matter",
        ),
        Mistake(
            lambda norms: math.floor(norms.max() / len(norms)) + 1,
            "this divides by the number of measured steps; the step size h is the unknown",
        ),
    ]
    drawn = torch.linspace(0.1, 1.0, 12, dtype=torch.float64).reshape(3, 4)
    cases = [
        Case("a field that steepens", (7.3 * drawn,)),
        Case("a field that calms down", (12.6 * drawn.flip(0),)),
        Case("a steepest place of exactly 4", (4 * drawn,)),
        Case("a gentle field", (0.8 * drawn,)),
        Case("no velocity", (0 * drawn,)),
        Case("one moment and one point", (torch.tensor([[2.5]], dtype=torch.float64),)),
    ]
    check_answer(function, lambda norms: math.floor(norms.max()) + 1, cases, mistakes, "safe_steps")


def equal_time(function: object) -> None:
    """Check ``function(times, values, other_times, other_values)``: both curves when the first of the two is done."""
    mistakes = [
        Mistake(
            lambda t, x, s, y: torch.stack([x[-1], y[-1]]),
            "these are the last values: equal steps, not equal seconds",
        ),
        Mistake(
            lambda t, x, s, y: torch.stack([x[min(len(t), len(s)) - 1], y[min(len(t), len(s)) - 1]]),
            "this compares at equal numbers of checks; compare at equal seconds",
        ),
        Mistake(
            lambda t, x, s, y: torch.stack([_held(t, x, min(t[-1], s[-1])), _held(s, y, min(t[-1], s[-1]))]),
            "this takes the value of the last check before that time; interpolate linearly between checks",
        ),
        Mistake(
            lambda t, x, s, y: _both(t, x, s, y, (t[-1] + s[-1]) / 2),
            "one of the runs ended earlier; compare at the time at which the shorter run ends",
        ),
        Mistake(lambda t, x, s, y: _both(t, x, s, y, min(t[-1], s[-1])).flip(0), "the two values are exchanged"),
        Mistake(
            lambda t, x, s, y: torch.stack([x.min(), y.min()]),
            "the least value is not the value at that time",
        ),
    ]
    cases = [Case(name, curves) for name, curves in _histories().items()]
    check_answer(function, lambda t, x, s, y: _both(t, x, s, y, min(t[-1], s[-1])), cases, mistakes, "equal_time")


def _histories() -> dict[str, Curves]:
    """Pairs of curves: times and values of one, times and values of the other."""

    def curve(*numbers: float) -> Float[Tensor, " n"]:
        return torch.tensor(numbers, dtype=torch.float64)

    slow, quick = (curve(0, 10, 20, 30), curve(4, 2, 1, 0.6)), (curve(0, 3, 6, 9, 12), curve(4, 3, 2.5, 2, 1.8))
    bumpy = curve(0, 4, 8, 16), curve(3, 1, 2, 1.5)
    return {
        "a slow and a fast run": (*slow, *quick),
        "a fast and a slow run": (*quick, *slow),
        "a run whose error increases in between": (*slow, *bumpy),
        "two runs that end together": (*quick, curve(0, 12), curve(5, 1)),
        "a run that ends at a check of the other": (curve(0, 10), curve(2, 1), *slow),
    }


def _both(times: Tensor, values: Tensor, other_times: Tensor, other_values: Tensor, moment: Tensor) -> Tensor:
    return torch.stack([_between(times, values, moment), _between(other_times, other_values, moment)])


def _between(times: Tensor, values: Tensor, moment: Tensor) -> Float[Tensor, ""]:
    """The value on the straight line between the checks around a moment; the last one after the end."""
    after = int(torch.searchsorted(times, moment).clamp(1, len(times) - 1))
    part = ((moment - times[after - 1]) / (times[after] - times[after - 1])).clamp(0, 1)
    return values[after - 1] + part * (values[after] - values[after - 1])


def _held(times: Tensor, values: Tensor, moment: Tensor) -> Float[Tensor, ""]:
    return values[int((times <= moment).sum()) - 1]
