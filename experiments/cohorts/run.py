"""Summarise generated cohorts: areas, volumes, thickness, contrast and noise of every scan.

The cohorts have to be made first (``data_synth/README.md``). Only finished scans are summarised.
"""

import json
import sys
from pathlib import Path

import numpy as np
import scipy.ndimage

from meshot.synth import LABELS, Subject, read_subject, scans

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


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


def tasks(config: dict) -> list[dict]:
    """All finished scans."""
    return [
        {"cohort": name, "participant": scan.participant.participant_id, "session": scan.session, "run": scan.run}
        for name in made(config)
        for scan in scans(Path(config["made_in"]) / name)
    ]


def made(config: dict) -> list[str]:
    """The cohorts that exist."""
    return [name for name in config["cohorts"] if Path(config["made_in"], name).is_dir()]


def work(task: dict, config: dict) -> dict:
    """One row of the table."""
    return summary_of(task, Path(config["made_in"]))


def results(rows: list[dict], config: dict) -> dict:
    """The table, and the cost of the scans."""
    seconds = {name: cpu_seconds(Path(config["made_in"], name)) for name in made(config)}
    return {"scans": [row["task"] | row["found"] for row in rows], "cpu_seconds": seconds}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic cohorts", experiment.COHORTS)
