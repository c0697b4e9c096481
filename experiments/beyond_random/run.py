"""Compare ways to choose directions, and control variates, by the error of SW₂² over the number of directions."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, orthogonal_directions, quasi_directions, random_directions, varifold
from meshot.anatomy import fsaverage5_surface
from meshot.loss import slice_costs
from meshot.mesh import decimated, ellipsoid, folded_sphere
from meshot.statistics import bootstrap_interval
from meshot.types import Array, Tensor
from meshot_book.statistics import fitted_slope, short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


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


def summarise(rows: list[dict], config: dict) -> dict:
    """``methods``: for each pair, space and method the relative errors, slope and factor saved, with 95 % intervals."""
    groups: dict[tuple, dict[int, dict[str, list[float]]]] = {}
    for row in rows:
        task = row["task"]
        sizes = groups.setdefault((task["pair"], task["d"]), {})
        sizes.setdefault(task["n_directions"], {}).update(row["found"])
    found = []
    for (pair, d), sizes in groups.items():
        truth = reference(sizes)
        errors = {
            method: {n: np.array(sizes[n][method]) / truth - 1 for n in sizes if method in sizes[n]}
            for method in METHODS
        }
        for method in METHODS:
            common = {"pair": pair, "d": d, "method": method, "truth": short(truth)}
            found.append(common | _line(errors[method], errors["random"], config))
    return {"methods": found}


def reference(sizes: dict[int, dict[str, list[float]]]) -> float:
    """The reference value for errors: the mean of all estimates of unbiased methods at the largest L.

    The estimates are weighted by the inverse of their variances. Methods that fit coefficients have a bias of O(1/L)
    and are excluded.
    """
    last = {name: np.array(values) for name, values in sizes[max(sizes)].items() if "fitted" not in name}
    weights = {name: len(values) / values.var(ddof=1) for name, values in last.items()}
    return float(sum(weights[name] * values.mean() for name, values in last.items()) / sum(weights.values()))


def _line(errors: dict[int, np.ndarray], random: dict[int, np.ndarray], config: dict) -> dict:
    fitted = [n for n in sorted(errors) if n >= config["fit_from"]]
    slope, low, high = fitted_slope(fitted, [errors[n] for n in fitted], statistic="rms")
    at = config["compare_at"]
    return {
        "sizes": sorted(errors),
        "rmse": [short(np.sqrt(np.mean(errors[n] ** 2))) for n in sorted(errors)],
        "bias": [short(errors[n].mean()) for n in sorted(errors)],
        "slope": short(slope),
        "low": short(low),
        "high": short(high),
        "saved": factor_saved(random[at], errors[at]),
    }


def factor_saved(random: np.ndarray, errors: np.ndarray) -> dict:
    """The ratio of two root mean squares, with its 95 % bootstrap interval."""

    def factor(top: Array, bottom: Array, axis: int) -> Array:
        return np.sqrt(np.mean(top**2, axis=axis) / np.mean(bottom**2, axis=axis))

    found = bootstrap_interval(random, errors, statistic=factor)
    return {name: short(value) for name, value in zip(("factor", "low", "high"), found)}


def measures(pair: str, d: int, config: dict) -> tuple[DiscreteMeasure, DiscreteMeasure]:
    """Two varifolds, or only their positions in R³."""
    settings = config["pairs"][pair]
    if pair == "cortex":
        meshes = [decimated(fsaverage5_surface(kind, "left"), settings["n_faces"]) for kind in ("white", "pial")]
    else:
        folded, smooth = folded_sphere(config["subdivisions"], 1.0, 0.15, 5), ellipsoid(2, (1.1, 0.9, 0.8))
        meshes = [folded, smooth.with_vertices(smooth.vertices + torch.tensor(settings["shift"], dtype=torch.float64))]
    return tuple(_encoded(mesh, d, settings["normal_scale"]) for mesh in meshes)


def _encoded(mesh: Mesh, d: int, normal_scale: float) -> DiscreteMeasure:
    encoded = varifold(mesh, normal_scale=normal_scale)
    return DiscreteMeasure(encoded.points[:, :d].contiguous(), encoded.weights)


def estimates(task: dict, config: dict) -> dict[str, list[float]]:
    """For one pair, space, way to choose directions and L: the estimates of every such method, for each set."""
    source, target = measures(task["pair"], task["d"], config)
    controls = Controls(source, target)
    methods = {
        name: estimate
        for name, (way, estimate) in METHODS.items()
        if way == task["way"] and task["n_directions"] >= least_directions(name, task["d"])
    }
    found: dict[str, list[float]] = {name: [] for name in methods}
    for k in range(task["n_sets"]):
        seed = int(np.random.SeedSequence([config["seed"], task["n_directions"], k]).generate_state(1)[0])
        directions = drawn_directions(task["way"], task["n_directions"], task["d"], seed)
        costs = slice_costs(source, target, directions).numpy()
        for name, estimate in methods.items():
            found[name].append(float(f"{estimate(costs, directions.numpy(), controls):.8g}"))
    return found


def tasks(config: dict) -> list[dict]:
    """All combinations of pair, space, way to choose directions, and L."""
    return [
        {"pair": pair, "d": d, "way": way, "n_directions": n_directions, "n_sets": n_sets}
        for n_directions, n_sets in zip(config["sizes"], config["n_sets"], strict=True)
        for pair in config["pairs"]
        for d in config["dimensions"]
        for way in dict.fromkeys(way for way, _ in METHODS.values())
    ]


if __name__ == "__main__":
    data = "synthetic surfaces; FreeSurfer's fsaverage5, left hemisphere"
    experiment.run(__file__, tasks, estimates, summarise, data)
