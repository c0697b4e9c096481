"""Compare ways to choose directions, and control variates, by the error of SW₂² over the number of directions.

Run as ``python experiments/beyond_random/run.py``. Finished pairs are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from estimators import METHODS, Controls, drawn_directions, least_directions
from summary import summarise

from meshot import DiscreteMeasure, Mesh, varifold
from meshot.anatomy import fsaverage5_surface
from meshot.loss import slice_costs
from meshot.mesh import decimated, ellipsoid, folded_sphere

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


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
