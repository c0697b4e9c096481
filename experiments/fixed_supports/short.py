"""The first iterations of one fit, which can be reproduced on another machine.

    python experiments/fixed_supports/short.py

A whole fit is chaotic: Adam divides by the size of the gradient, so that rounding decides the sign of steps where the
gradient is nearly zero. The first iterations are not chaotic. Writes ``short.json``, in seconds.
"""

import time
from pathlib import Path

import numpy as np
import torch
import yaml
from run import MEASURED, fit_loss, pair_of_meshes

from meshot import evaluate
from meshot.flow import FitSettings, fit_flow, grid_around
from meshot.provenance import write_results
from meshot_book.statistics import short

HERE = Path(__file__).parent
TASK = {"variant": "drawn", "n_supports": 500, "seed": 0, "n_iterations": 8}


def short_fit(task: dict, config: dict, nudge: float = 0.0) -> dict[str, float]:
    """Closeness and regularity after ``n_iterations``, with every initial vertex moved by ``nudge`` mm."""
    fits = config["fits"]
    start, target = pair_of_meshes(fits["subdivisions"], task["seed"], config)
    moved = np.random.default_rng(1).standard_normal(tuple(start.vertices.shape))
    start = start.with_vertices(start.vertices + nudge * torch.from_numpy(moved).to(start.vertices))
    grid = config["grid"] | {"spacings": tuple(config["grid"]["spacings"])}
    settings = FitSettings(
        n_iterations=task["n_iterations"], learning_rate=fits["learning_rate"], n_steps=config["n_steps"],
        n_directions=tuple(fits["n_directions"]), seed=task["seed"],
    )  # fmt: skip
    loss = fit_loss(task["variant"], task["n_supports"], start, target, config["normal_scale"])
    fitted = fit_flow(grid_around(start.vertices, target.vertices, **grid), start, loss, settings)
    values = evaluate(fitted.mesh, target, config["n_points"], n_emd_points=100)
    return {name: short(getattr(values, name).value) for name in MEASURED}


def main() -> None:
    """Write the numbers of the short fit."""
    torch.set_num_threads(1)
    began = time.process_time()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    results = {"task": TASK, "found": short_fit(TASK, config)}
    command, data = "python experiments/fixed_supports/short.py", "analytic folded surfaces"
    write_results(HERE / "short.json", results, config, command, data, time.process_time() - began)


if __name__ == "__main__":
    main()
