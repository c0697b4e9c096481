"""Methods to choose directions, and estimators of SW₂² from the costs along them."""

from collections.abc import Callable

import numpy as np

from meshot import DiscreteMeasure, orthogonal_directions, quasi_directions, random_directions
from meshot.types import Tensor


def drawn_directions(way: str, n: int, d: int, seed: int) -> Tensor:
    """A set of directions: "random", "orthogonal", "quasi" (the default in R^d), or "frames" (Sobol frames)."""
    if way == "random":
        return random_directions(n, d, seed)
    if way == "orthogonal":
        return orthogonal_directions(n, d, seed)
    return quasi_directions(n, d, seed, method="sobol frames" if way == "frames" else None)


class Controls:
    """Control variates: functions of a direction whose mean over the sphere is known.

    For p = 2 the cost along θ is ⟨t, θ⟩² plus the cost of the centred measures, where t is the difference of the means.
    The mean of ⟨t, θ⟩² is |t|²/d. The mean of the variance θᵀΣθ of a projection is trace(Σ)/d.
    """

    def __init__(self, source: DiscreteMeasure, target: DiscreteMeasure):
        self.d = source.points.shape[1]
        moments = [_moments(measure) for measure in (source, target)]
        self.shift = moments[0][0] - moments[1][0]
        self.covariances = [covariance for _, covariance in moments]

    def mean_part(self, directions: np.ndarray) -> np.ndarray:
        """⟨t, θ⟩² minus its mean."""
        return (directions @ self.shift) ** 2 - self.shift @ self.shift / self.d

    def moments_part(self, directions: np.ndarray) -> np.ndarray:
        """⟨t, θ⟩² and both variances of the projections, minus their means, one column each."""
        columns = [self.mean_part(directions)]
        for covariance in self.covariances:
            columns.append(np.einsum("ld,de,le->l", directions, covariance, directions) - covariance.trace() / self.d)
        return np.stack(columns, axis=1)

    def quadratic_part(self, directions: np.ndarray) -> np.ndarray:
        """All products θᵢθⱼ minus their means, without the last square (the squares sum to one)."""
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
    """The mean of the costs minus ⟨t, θ⟩², plus |t|²/d. Unbiased, since nothing is fitted."""
    return float((costs - controls.mean_part(directions)).mean())


def without_moments(costs: np.ndarray, directions: np.ndarray, controls: Controls) -> float:
    """The intercept of a least-squares fit on the mean part and both variances."""
    return _intercept(costs, controls.moments_part(directions))


def without_quadratics(costs: np.ndarray, directions: np.ndarray, controls: Controls) -> float:
    """The intercept of a least-squares fit on all quadratic forms."""
    return _intercept(costs, controls.quadratic_part(directions))


def _intercept(costs: np.ndarray, columns: np.ndarray) -> float:
    design = np.column_stack([np.ones(len(costs)), columns])
    return float(np.linalg.lstsq(design, costs, rcond=None)[0][0])


#: Name, way to choose directions, estimator. The others are compared with the first.
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
    """The smallest number of directions for a method: twice the number of coefficients that it fits."""
    fitted = {without_moments: 3, without_quadratics: d * (d + 1) // 2 - 1}.get(METHODS[method][1], 0)
    return 2 * (fitted + 1)
