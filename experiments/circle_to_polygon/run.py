"""Run the toy experiment for polygons, samplings, reductions, directions, regularisers and numbers of points."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import meshot.loss
import meshot.mesh
from meshot import DiscreteMeasure, chamfer, quasi_directions, random_directions, sliced_wasserstein
from meshot.mesh import Contour, circle, closed_contour, edge_lengths, even_points, sample_points
from meshot.provenance import rounded
from meshot.types import Tensor
from meshot_book.examples import coverage, distance_to_contour, evenness, exact_distance
from meshot_book.flows import descend
from meshot_book.statistics import arm_differences, short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


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


MEASURED = ("w2", "coverage", "coverage_3", "evenness", "off_contour", "chamfer", "sw")


def summarise(rows: list[dict]) -> dict:
    """Statistics of every part over seeds, and Chamfer minus sliced Wasserstein where both were run."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(repr(row["run"]), []).append(row)
    results: dict[str, list] = {"summary": [], "differences": [], "regularisers": [], "sizes": []}
    for group in groups.values():
        run = dict(group[0]["run"])
        results[run.pop("part")].append(run | _statistics(group))
    main = [row for row in results["summary"] if row["reduction"] == "mean"]
    for trapped in (row for row in main if row["loss"] == "chamfer"):
        for rival in (row for row in main if row["loss"] == "sliced"):
            if all(rival[name] == trapped[name] for name in ("polygon", "sampling")):
                results["differences"].append(_difference(trapped, rival))
    return results


def _statistics(group: list[dict]) -> dict:
    found = {}
    for name in MEASURED:
        values = np.array([row["values"][name] for row in group])
        found[f"{name}_mean"], found[f"{name}_sd"] = short(values.mean()), short(values.std(ddof=1))
        found[f"{name}_seeds"] = [short(value) for value in values]
    return found | {"n_seeds": len(group)}


def _difference(trapped: dict, rival: dict) -> dict:
    """Mean over seeds of the paired difference Chamfer minus sliced Wasserstein, with its 95 % interval (Student)."""
    found = {name: trapped[name] for name in ("polygon", "sampling")} | {"redraw": rival["redraw"]}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (trapped, rival))
    return found | rounded(arm_differences(*arms, centre="mean")) | {"n_seeds": len(trapped["w2_seeds"])}


def floors(config: dict) -> list[dict]:
    """The metrics of an even sampling, and of an independent sample of the target, against another sample."""
    rows = []
    for name, settings in config["polygons"].items():
        shape = polygon(settings)
        for sampling in config["samplings"]:
            group = []
            for seed in range(config["n_floor_samples"]):
                generator = np.random.default_rng([seed, 2])
                pair = [draw_points(shape, config["n_points"], sampling, generator) for _ in range(2)]
                group.append({"values": judged(pair[0], DiscreteMeasure(pair[1]), shape)})
            row = _statistics(group)
            kept = {key: value for key, value in row.items() if not key.endswith("_seeds") or key == "n_seeds"}
            rows.append({"polygon": name, "sampling": sampling} | kept)
    return rows


def sweep_runs(config: dict) -> list[dict]:
    """The settings of all runs, except the seed."""
    base = {"n_points": config["n_points"], "sampling": "even"}
    main = [
        {"part": "summary", **base, "polygon": polygon, "sampling": sampling, **variant}
        for polygon in config["polygons"]
        for sampling in config["samplings"]
        for variant in config["variants"]
    ]
    plain = config["variants"][0]
    held = [
        {"part": "regularisers", **base, "polygon": polygon, **plain, "regulariser": name, "weight": weight}
        for polygon in config["regularisers"]["polygons"]
        for name, weights in config["regularisers"]["weights"].items()
        for weight in weights
    ]
    star = next(iter(config["polygons"]))
    sliced_mean, sliced_sum = config["variants"][3], config["variants"][5]
    sizes = [
        {"part": "sizes", **base, "polygon": star, "n_points": n_points, **variant}
        for n_points in config["sizes"]
        for variant in (plain, sliced_mean, sliced_sum)
    ]
    return main + held + sizes


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All settings and seeds."""
    return [(run, seed) for run in sweep_runs(config) for seed in config["seeds"]]


def results(rows: list[dict], config: dict) -> dict:
    """The runs, and the floors of the metrics."""
    runs = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    return summarise(runs) | {"floors": floors(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, lambda task, config: run_once(*task, config), results, "synthetic polygons")
