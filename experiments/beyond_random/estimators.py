"""Ways to draw directions, and ways to turn the costs along them into an estimate of SW₂²."""

from collections.abc import Callable

import numpy as np

from meshot import DiscreteMeasure, orthogonal_directions, quasi_directions, random_directions
from meshot.types import Tensor


def drawn_directions(way: str, n: int, d: int, seed: int) -> Tensor:
    """A set of directions: "random", "orthogonal", "quasi" (the default of R^d), or "frames" (Sobol frames)."""
    if way == "random":
        return random_directions(n, d, seed)
    if way == "orthogonal":
        return orthogonal_directions(n, d, seed)
    return quasi_directions(n, d, seed, method="sobol frames" if way == "frames" else None)


class Controls:
    """Functions of a direction whose mean over the sphere is known: what is left of a cost after them varies less.

    For p = 2 the cost along θ is ⟨t, θ⟩² plus that of the centred measures, where t is the difference of the means; the
    mean of ⟨t, θ⟩² is |t|²/d. The variances θᵀΣθ of the projections have the mean trace(Σ)/d.
    """

    def __init__(self, source: DiscreteMeasure, target: DiscreteMeasure):
        self.d = source.points.shape[1]
        moments = [_moments(measure) for measure in (source, target)]
        self.shift = moments[0][0] - moments[1][0]
        self.covariances = [covariance for _, covariance in moments]

    def mean_part(self, directions: np.ndarray) -> np.ndarray:
        """⟨t, θ⟩² less its mean."""
        return (directions @ self.shift) ** 2 - self.shift @ self.shift / self.d

    def moments_part(self, directions: np.ndarray) -> np.ndarray:
        """⟨t, θ⟩² and both variances of the projections, less their means: a column each."""
        columns = [self.mean_part(directions)]
        for covariance in self.covariances:
            columns.append(np.einsum("ld,de,le->l", directions, covariance, directions) - covariance.trace() / self.d)
        return np.stack(columns, axis=1)

    def quadratic_part(self, directions: np.ndarray) -> np.ndarray:
        """All products θᵢθⱼ less their means, the last square left out (the squares add up to one)."""
        rows, columns = np.triu_indices(self.d)
        products = directions[:, rows] * directions[:, columns] - (rows == columns) / self.d
        return products[:, :-1]


def _moments(measure: DiscreteMeasure) -> tuple[np.ndarray, np.ndarray]:
    points, weights = measure.points.numpy(), measure.weights.numpy()
    mean = weights @ points
    centred = points - mean
    return mean, (centred * weights[:, None]).T @ centred


def plain(costs: np.ndarray, *_: object) -> float:
    """The mean of the costs."""
    return float(costs.mean())


def without_mean_part(costs: np.ndarray, directions: np.ndarray, controls: Controls) -> float:
    """The mean of the costs less ⟨t, θ⟩², plus |t|²/d: unbiased, nothing is fitted."""
    return float((costs - controls.mean_part(directions)).mean())


def without_moments(costs: np.ndarray, directions: np.ndarray, controls: Controls) -> float:
    """Least squares on the mean part and both variances."""
    return _intercept(costs, controls.moments_part(directions))


def without_quadratics(costs: np.ndarray, directions: np.ndarray, controls: Controls) -> float:
    """Least squares on every quadratic form."""
    return _intercept(costs, controls.quadratic_part(directions))


def _intercept(costs: np.ndarray, columns: np.ndarray) -> float:
    design = np.column_stack([np.ones(len(costs)), columns])
    return float(np.linalg.lstsq(design, costs, rcond=None)[0][0])


#: Name, way to draw, estimator. The first is what all others are compared with.
METHODS: dict[str, tuple[str, Callable[..., float]]] = {
    "random": ("random", plain),
    "random, mean part known": ("random", without_mean_part),
    "random, moments fitted": ("random", without_moments),
    "random, quadratics fitted": ("random", without_quadratics),
    "orthogonal": ("orthogonal", plain),
    "orthogonal, mean part known": ("orthogonal", without_mean_part),
    "quasi": ("quasi", plain),
    "quasi, quadratics fitted": ("quasi", without_quadratics),
    "frames": ("frames", plain),
}


def least_directions(method: str, d: int) -> int:
    """Below how many directions a method is not tried: twice the number of coefficients it fits."""
    fitted = {without_moments: 3, without_quadratics: d * (d + 1) // 2 - 1}.get(METHODS[method][1], 0)
    return 2 * (fitted + 1)
