"""Evaluate the registered mean surface on every test subject, and the surface of a perfect segmentation.

Run as ``python experiments/template_baseline/run.py`` after the cohorts have been made (``data_synth/README.md``).
Every result is stored, so that a stopped run can be resumed.
"""

import argparse
import functools
import time
from pathlib import Path

import numpy as np
import torch
import yaml
from baseline import perfect_mask_surface, registered_template, template_in_standard_space

from meshot.anatomy import HEMISPHERES
from meshot.jobs import run_jobs
from meshot.metrics import evaluate
from meshot.provenance import write_results
from meshot.synth import participants, read_recipe, read_subject

HERE = Path(__file__).resolve().parent
COHORTS = HERE.parents[1] / "build" / "cohorts"
MEASURED = ("assd", "hausdorff", "swd", "emd", "normals")


def main() -> None:
    """Compute the missing results, then write the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cohorts", type=Path, default=COHORTS, help="the folder that holds the cohorts")
    folder = parser.parse_args().cohorts
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    tasks = [
        {"cohort": name, "participant": person.participant_id, "kind": person.kind, "side": side}
        for name in config["cohorts"]
        for person in participants(folder / name, "test")
        for side in HEMISPHERES
    ]
    partial = HERE / "partial.jsonl"
    rows = run_jobs(
        tasks, lambda task: score(task, folder, config), partial, folder=HERE, config=config | {"made_in": str(folder)},
        clock=time.process_time,
    )  # fmt: skip
    results = {"scores": [row["task"] | row["found"] for row in rows]}
    results["summary"] = summarise(results["scores"])
    seconds = sum(row["seconds"] for row in rows)
    write_results(HERE / "results.json", results, config, "python experiments/template_baseline/run.py",
                  "synthetic cohorts adni_like and oasis_like", seconds)  # fmt: skip
    partial.unlink(missing_ok=True)


@functools.cache
def _template(recipe_path: Path) -> dict:
    return template_in_standard_space(read_recipe(recipe_path))


def score(task: dict, folder: Path, config: dict) -> dict:
    """The metrics of the template and of the perfect mask for one hemisphere, in scanner mm."""
    subject = read_subject(folder / task["cohort"], task["participant"])
    true = subject.surface("white", task["side"])
    guesses = {
        "template": registered_template(_template(folder / task["cohort"] / "recipe.yaml"), subject, task["side"]),
        "perfect mask": perfect_mask_surface(subject, task["side"]),
    }
    found = {}
    for name, mesh in guesses.items():
        judged = evaluate(mesh, true, config["n_points"], config["seed"], config["n_emd_points"]).as_dict()
        found[name] = {key: float(f"{judged[key]['value']:.6g}") for key in MEASURED}
        found["floor"] = {key: float(f"{judged[key]['floor']:.6g}") for key in MEASURED}
    return found


def summarise(scores: list[dict]) -> list[dict]:
    """ASSD over the hemispheres of each cohort and kind of subject, and the smallest difference of the two."""
    rows = []
    for cohort, kind in sorted({(s["cohort"], s["kind"]) for s in scores}):
        own = [s for s in scores if (s["cohort"], s["kind"]) == (cohort, kind)]
        row = {"cohort": cohort, "kind": kind, "hemispheres": len(own)}
        for guess in ("template", "perfect mask"):
            values = [s[guess]["assd"] for s in own]
            row |= {f"{guess} mean": float(np.mean(values)), f"{guess} sd": float(np.std(values, ddof=1))}
            row |= {f"{guess} least": min(values), f"{guess} most": max(values)}
        row["least ratio"] = min(s["template"]["assd"] / s["perfect mask"]["assd"] for s in own)
        rows.append({key: float(f"{v:.6g}") if isinstance(v, float) else v for key, v in row.items()})
    return rows


if __name__ == "__main__":
    main()
