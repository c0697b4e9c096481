"""One hemisphere trained on alone: what duration and width give, and what the loss itself allows.

Run as ``python experiments/one_subject/run.py``, on one thread; some eighty minutes. It needs no cohort.
``config.yaml`` is the protocol. Finished arms are stored in ``partial.jsonl``, and a training resumes from its last
state.

``results.json`` has, under "results":

- ``surfaces``: for the initial surface and the last weights of every arm: ``arm``, ``assd_mm``, ``hausdorff90_mm``,
  ``normals``, ``intersecting_percent``, and the sliced losses in mm² with normals of 20 and 100 mm, ``sliced_20`` and
  ``sliced_100``; in addition ``n_steps``, ``n_weights`` and ``cpu_seconds`` of an arm;
- ``curves``: for every arm the ``step`` of each check, ``assd_mm``, and ``loss``, the mean training loss of the steps
  since the previous check.
"""

import time
from pathlib import Path

import numpy as np
import torch
import yaml

from meshot import evaluate
from meshot.jobs import run_jobs
from meshot.loss import quasi_directions, sliced_wasserstein
from meshot.measure import varifold
from meshot.mesh import Mesh
from meshot.provenance import rounded, write_results
from meshot.systems import DeformationExample, deformed, get_system, read_settings, train_deformation
from meshot.train import Progress, Training
from meshot_book.example_file import read_example

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def settings_of(arm: dict, config: dict) -> list[str]:
    """The settings of an arm that differ from those of its system. One subject makes an epoch one step."""
    plan = {
        "side": config["side"], "n_epochs": arm["steps"], "validate_every": config["validate_every"],
        "n_points": config["n_points"], "seed": config["seed"],
    }  # fmt: skip
    return [*(f"training.{name}={value}" for name, value in plan.items()), *arm.get("changes", [])]


def measured(mesh: Mesh, example: DeformationExample, config: dict) -> dict[str, float]:
    """Distances from the true surface, and the sliced losses in many directions."""
    values = evaluate(mesh, example.target, config["n_points"], config["seed"], n_emd_points=100)
    lines = quasi_directions(config["n_directions"], 6, seed=config["seed"])
    sliced = {
        f"sliced_{scale}": float(
            sliced_wasserstein(*(varifold(each, normal_scale=float(scale)) for each in (mesh, example.target)), lines)
        )
        for scale in config["normal_scales"]
    }
    return {
        "assd_mm": values.assd.value, "hausdorff90_mm": values.hausdorff.value, "normals": values.normals.value,
        "intersecting_percent": values.intersecting_share.value,
    } | sliced  # fmt: skip


def curve(log: list[dict]) -> dict[str, list[float]]:
    """The distance at every check, and the mean loss of the steps since the previous check."""
    checks = [line for line in log if "validation_loss" in line]
    losses = {line["step"]: line["loss"] for line in log if "loss" in line}
    ends = [line["step"] for line in checks]
    means = [
        float(np.mean([losses[step] for step in losses if start < step <= end]))
        for start, end in zip([0, *ends], ends, strict=False)
    ]
    return {"step": ends, "assd_mm": [line["validation_loss"] for line in checks], "loss": means}


def trained(name: str, example: DeformationExample, config: dict, progress: Progress | None = None) -> Training:
    """Train one arm, or resume its training."""
    arm = config["arms"][name]
    system = get_system(arm["system"])
    settings = read_settings(system, config["settings"], settings_of(arm, config))
    folder = ROOT / config["state"] / name
    return train_deformation(settings, [example], [example], folder, progress, torch.device("cpu"))


def train_arm(name: str, config: dict) -> dict:
    """Train one arm; its surface with the last weights, measured, and its curve."""
    example, _ = read_example(ROOT / config["example"])
    found = trained(name, example, config)
    found.network.load_state_dict(found.last)
    mesh = deformed(example.initial, example.scan, found.network)
    whole = found.results()
    numbers = {key: whole[key] for key in ("n_steps", "n_weights", "cpu_seconds")}
    return rounded({"surface": measured(mesh, example, config) | numbers, "curve": curve(found.log)})


def main() -> None:
    """Train the missing arms and write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    rows = run_jobs(
        list(config["arms"]), lambda name: train_arm(name, config), partial, folder=HERE, config=config,
        clock=time.process_time,
    )  # fmt: skip
    example, record = read_example(ROOT / config["example"])
    surfaces = [{"arm": "initial"} | rounded(measured(example.initial, example, config))]
    surfaces += [{"arm": row["task"]} | row["found"]["surface"] for row in rows]
    curves = {row["task"]: row["found"]["curve"] for row in rows}
    stands_on = f"one hemisphere of a synthetic cohort: {record['name']}, {record['side']}"
    seconds = sum(row["found"]["surface"]["cpu_seconds"] for row in rows)
    command = "python experiments/one_subject/run.py"
    write_results(HERE / "results.json", {"surfaces": surfaces, "curves": curves}, config, command, stands_on, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
