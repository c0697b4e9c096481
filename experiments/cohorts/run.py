"""Summarise generated cohorts: areas, volumes, thickness, contrast and noise of every scan.

Run as ``python experiments/cohorts/run.py`` after the cohorts have been made (``data_synth/README.md``). Only finished
scans are summarised.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import scipy.ndimage
import torch
import yaml

from meshot.jobs import run_jobs
from meshot.provenance import write_results
from meshot.synth import LABELS, Subject, read_subject, scans

HERE = Path(__file__).resolve().parent
COHORTS = HERE.parents[1] / "build" / "cohorts"


def main() -> None:
    """Summarise each scan, then write the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cohorts", type=Path, default=COHORTS, help="the folder that holds the cohorts")
    folder = parser.parse_args().cohorts
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    tasks = [
        {"cohort": name, "participant": scan.participant.participant_id, "session": scan.session, "run": scan.run}
        for name in config["cohorts"]
        if (folder / name).is_dir()
        for scan in scans(folder / name)
    ]
    partial = HERE / "partial.jsonl"
    rows = run_jobs(
        tasks, lambda task: summary_of(task, folder), partial, folder=HERE, config=config | {"made_in": str(folder)},
        clock=time.process_time,
    )  # fmt: skip
    results = {"scans": [row["task"] | row["found"] for row in rows]}
    results["cpu_seconds"] = {
        name: cpu_seconds(folder / name) for name in config["cohorts"] if (folder / name).is_dir()
    }
    seconds = sum(row["seconds"] for row in rows)
    write_results(HERE / "results.json", results, config, "python experiments/cohorts/run.py", "synthetic cohorts",
                  seconds)  # fmt: skip
    partial.unlink(missing_ok=True)


def summary_of(task: dict, folder: Path) -> dict:
    """One row of the table."""
    return scan_summary(read_subject(folder / task["cohort"], task["participant"], task["session"], task["run"]))


def scan_summary(subject: Subject) -> dict:
    """Anatomy measured on the true surfaces; contrast and noise measured in the image."""
    facts = subject.facts()
    of = facts["surfaces"]
    image, labels = subject.scan().data, subject.tissue().data
    pure = {
        tissue: np.median(image[np.isin(labels, (LABELS[f"left {tissue}"], LABELS[f"right {tissue}"]))])
        for tissue in ("white", "grey")
    }
    # Without signal, the magnitude has a Rayleigh distribution with mean σ √(π/2).
    far = scipy.ndimage.binary_erosion(labels == 0, iterations=5)
    noise = image[far].mean() / np.sqrt(np.pi / 2)
    numbers = {
        "white_area_cm2": sum(of[f"{side} white"]["area_cm2"] for side in ("left", "right")),
        "white_volume_ml": sum(of[f"{side} white"]["volume_ml"] for side in ("left", "right")),
        "pial_area_cm2": sum(of[f"{side} pial"]["area_cm2"] for side in ("left", "right")),
        "pial_volume_ml": sum(of[f"{side} pial"]["volume_ml"] for side in ("left", "right")),
        "thickness_mm": np.mean([of[f"{side} thickness_mm"]["median"] for side in ("left", "right")]),
        "white": pure["white"],
        "grey": pure["grey"],
        "noise": noise,
        "contrast_to_noise": (pure["white"] - pure["grey"]) / noise,
        "noise_set": facts["knobs"]["appearance"]["noise"],
        "strength": facts["deformation_strength"],
        "enlargement": np.linalg.det(subject.to_standard()[:3, :3]) ** (1 / 3),
    }
    about = {"split": subject.participant.split, "kind": subject.participant.kind}
    crossing = sum(of[f"{side} {kind}"]["crossing_faces"] for side in ("left", "right") for kind in ("white", "pial"))
    return about | {key: float(f"{value:.5g}") for key, value in numbers.items()} | {"crossing_faces": crossing}


def cpu_seconds(cohort: Path) -> dict[str, float]:
    """Median CPU seconds for each stage of a scan."""
    logs = [json.loads(path.read_text(encoding="utf-8"))["cpu_seconds"] for path in (cohort / "logs").glob("*.json")]
    stages = [stage for log in logs for name, stage in log.items() if name != "total"]
    return {name: float(f"{np.median([s[name] for s in stages]):.3g}") for name in stages[0]} if stages else {}


if __name__ == "__main__":
    main()
