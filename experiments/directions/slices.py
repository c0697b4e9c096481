"""The problems of this experiment: exact costs along a direction, and their mean over all directions."""

import functools
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot import (
    DiscreteMeasure,
    orthogonal_directions,
    quasi_directions,
    random_directions,
    slice_costs,
    surface,
    varifold,
)
from meshot.loss import CONSTRUCTIONS
from meshot.measure import SurfaceMeasure
from meshot.mesh import Contour, circle, ellipsoid, folded_sphere, icosphere, letter_e, star

Measure = SurfaceMeasure | DiscreteMeasure
Cost = Callable[[torch.Tensor], np.ndarray]


def slice_cost(problem: dict, config: dict) -> Cost:
    """The function from directions to W_p^p along each of them."""
    p = problem["p"]
    if problem["pair"] == "translation":
        return lambda directions: np.abs(directions[:, 0].numpy()) ** p
    source, target = _pair(problem["d"], problem["pair"], config)
    return lambda directions: slice_costs(source, target, directions, p).numpy()


def _pair(d: int, name: str, config: dict) -> tuple[Measure, Measure]:
    if d == 2:
        round_one = circle(n_corners=90)
        long = Contour(round_one.vertices * torch.tensor(config["radii"][:2]), round_one.edges)
        return {
            "ellipsoid": (surface(long), surface(round_one)),
            "folded": (surface(star(5, 1.5, 0.35)), surface(letter_e())),
        }[name]
    level = config["subdivisions"]
    other = {
        "ellipsoid": lambda: ellipsoid(level, tuple(config["radii"])),
        "folded": lambda: folded_sphere(level, 1.0, 0.2),
    }
    encode = surface if d == 3 else lambda mesh: varifold(mesh, normal_scale=config["normal_scale"])
    return encode(other[name]()), encode(icosphere(level))


def mean_over_all(problem: dict, config: dict) -> tuple[float, float]:
    """The mean over all directions and its standard error, which is zero if there is a closed form, E|θ₁|^p."""
    d, p = problem["d"], problem["p"]
    if problem["pair"] == "translation":
        moment = math.gamma(d / 2) * math.gamma((p + 1) / 2) / (math.gamma((d + p) / 2) * math.sqrt(math.pi))
        return moment, 0.0
    cost = slice_cost(problem, config)
    (setting,) = [entry for entry in config["reference"]["sets"] if entry["d"] == d]
    n_turns = config["reference"]["n_turns"]
    means = [
        cost(quasi_directions(setting["n_directions"], d, 10_000 + turn, method=setting["method"])).mean()
        for turn in range(n_turns)
    ]
    return float(np.mean(means)), float(np.std(means, ddof=1) / math.sqrt(n_turns))


def methods(d: int) -> dict[str, Callable[[int, int], torch.Tensor]]:
    """The constructions by name, each as a function from (number, seed) to directions."""
    found = {"random": lambda n, seed: random_directions(n, d, seed)}
    found["orthogonal"] = lambda n, seed: orthogonal_directions(n, d, seed)
    for name, (_, only) in CONSTRUCTIONS.items():
        if only in (None, d):
            found[name] = functools.partial(_quasi, d, name)
    return found


def _quasi(d: int, name: str, n: int, seed: int) -> torch.Tensor:
    return quasi_directions(n, d, seed, method=name)


#: Constructions in which the first L rows of a long set are the set of L rows, so that one set serves every L.
NESTED = ("random", "orthogonal", "lattice", "sobol", "sobol frames")


def relative_errors(problem: dict, method: str, mean: float, config: dict) -> np.ndarray:
    """estimate / mean − 1, with shape (repetitions, numbers of directions)."""
    cost, make, counts = slice_cost(problem, config), methods(problem["d"])[method], config["n_directions"]
    errors = np.empty((config["n_repetitions"], len(counts)))
    for seed in range(config["n_repetitions"]):
        if method in NESTED:
            costs = cost(make(max(counts), seed))
            estimates = [costs[:n].mean() for n in counts]
        else:
            estimates = [cost(make(n, seed)).mean() for n in counts]
        errors[seed] = np.array(estimates) / mean - 1
    return errors
