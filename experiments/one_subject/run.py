"""One hemisphere trained on alone: what duration and width give, and what the loss itself allows.

Run as ``python experiments/one_subject/run.py``, on one thread; some eighty minutes. It needs no cohort.
``config.yaml`` is the protocol. A training resumes from its last state.

``results.json`` has, under "results":

- ``surfaces``: for the initial surface and the last weights of every arm: ``arm``, ``assd_mm``, ``hausdorff90_mm``,
  ``normals``, ``intersecting_percent``, and the sliced losses in mm² with normals of 20 and 100 mm, ``sliced_20`` and
  ``sliced_100``; in addition ``n_steps``, ``n_weights`` and ``cpu_seconds`` of an arm;
- ``curves``: for every arm the ``step`` of each check, ``assd_mm``, and ``loss``, the mean training loss of the steps
  since the previous check.
"""

import sys
from pathlib import Path

import torch

from meshot import evaluate
from meshot.loss import quasi_directions, sliced_wasserstein
from meshot.measure import varifold
from meshot.mesh import Mesh
from meshot.provenance import rounded
from meshot.systems import DeformationExample, deformed, get_system, read_settings, train_deformation
from meshot.train import Progress, Training
from meshot_book.example_file import read_example
from meshot_book.trainings import curve

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

ROOT = experiment.ROOT


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


def train_or_resume(name: str, example: DeformationExample, config: dict, progress: Progress | None = None) -> Training:
    """Train one arm, or resume its training."""
    arm = config["arms"][name]
    system = get_system(arm["system"])
    settings = read_settings(system, config["settings"], settings_of(arm, config))
    folder = ROOT / config["state"] / name
    return train_deformation(settings, [example], [example], folder, progress, torch.device("cpu"))


def train_arm(name: str, config: dict) -> dict:
    """Train one arm; its surface with the last weights, measured, and its curve."""
    example, _ = read_example(ROOT / config["example"])
    found = train_or_resume(name, example, config)
    found.network.load_state_dict(found.last)
    mesh = deformed(example.initial, example.scan, found.network)
    whole = found.results()
    numbers = {key: whole[key] for key in ("n_steps", "n_weights", "cpu_seconds")}
    return rounded({"surface": measured(mesh, example, config) | numbers, "curve": curve(found.log)})


def results(rows: list[dict], config: dict) -> dict:
    """The surfaces of the start and of every arm, and the curves."""
    example, _ = read_example(ROOT / config["example"])
    surfaces = [{"arm": "initial"} | rounded(measured(example.initial, example, config))]
    surfaces += [{"arm": row["task"]} | row["found"]["surface"] for row in rows]
    return {"surfaces": surfaces, "curves": {row["task"]: row["found"]["curve"] for row in rows}}


def data(config: dict) -> str:
    """The hemisphere."""
    _, record = read_example(ROOT / config["example"])
    return f"one hemisphere of a synthetic cohort: {record['name']}, {record['side']}"


if __name__ == "__main__":
    experiment.run(__file__, lambda config: list(config["arms"]), train_arm, results, data)
