"""One run of the toy experiment: points of a circle move to a polygon by gradient descent on one loss."""

from collections.abc import Callable

import numpy as np

import meshot.loss
import meshot.mesh
from meshot import DiscreteMeasure, chamfer, quasi_directions, random_directions, sliced_wasserstein
from meshot.mesh import Contour, circle, closed_contour, edge_lengths, even_points, sample_points
from meshot.types import Tensor
from meshot_book.examples import coverage, distance_to_contour, evenness, exact_distance
from meshot_book.flows import descend


def polygon(settings: dict) -> Contour:
    """The polygon described by an entry of the configuration."""
    settings = dict(settings)
    return getattr(meshot.mesh, settings.pop("shape"))(**settings)


def draw_points(contour: Contour, n_points: int, sampling: str, generator: np.random.Generator) -> Tensor:
    """Evenly spaced points with a random offset, or independent points."""
    if sampling == "even":
        return even_points(contour, n_points, generator.random())
    return sample_points(contour, n_points, generator)


def run_once(run: dict, seed: int, config: dict) -> dict:
    """Do one descent and evaluate the final points."""
    shape = polygon(config["polygons"][run["polygon"]])
    # All variants of one seed have the same initial points and target, so that differences are paired.
    place = np.random.default_rng([seed, 0])
    start = draw_points(circle(), run["n_points"], run["sampling"], place)
    target = DiscreteMeasure(draw_points(shape, run["n_points"], run["sampling"], place))
    loss = make_loss(run, target, config["n_directions"], np.random.default_rng([seed, 1]))
    end = descend(loss, start, config["n_steps"], run["learning_rate"], config["momentum"]).points
    return judged(end, target, shape)


def make_loss(run: dict, target: DiscreteMeasure, n_directions: int, generator: np.random.Generator) -> Callable:
    """The loss of free points described by a row of the sweep."""
    factor = run["n_points"] if run["reduction"] == "sum" else 1
    if run["loss"] == "sliced":
        fixed = random_directions(n_directions, 2, generator)

        def loss(points: Tensor) -> Tensor:
            directions = random_directions(n_directions, 2, generator) if run["redraw"] else fixed
            return factor * sliced_wasserstein(DiscreteMeasure(points), target, directions)

        return loss
    if "regulariser" not in run:
        return lambda points: factor * chamfer(DiscreteMeasure(points), target)
    penalty = getattr(meshot.loss, run["regulariser"])
    return lambda points: chamfer(DiscreteMeasure(points), target) + run["weight"] * penalty(closed_contour(points))


def judged(points: Tensor, target: DiscreteMeasure, shape: Contour) -> dict:
    """The metrics: exact W₂ to the target points, coverage of the contour, and both losses."""
    spacing = float(edge_lengths(shape).sum()) / len(points)
    measure = DiscreteMeasure(points)
    return {
        "w2": exact_distance(points, target.points),
        "coverage": coverage(points, shape),
        "coverage_3": coverage(points, shape, radius=3 * spacing),
        "evenness": evenness(points, shape),
        "off_contour": distance_to_contour(points, shape),
        "chamfer": float(chamfer(measure, target)),
        "sw": float(sliced_wasserstein(measure, target, quasi_directions(360, 2))),
    }
