"""A study with a known answer: two groups of six synthetic people, two visits each, from BIDS to a table.

Run as ``python experiments/study/run.py --jobs 2``. It makes two cohorts, writes their scans as a BIDS data set, and
reconstructs all visits with the networks of the package. A stopped run can be resumed: finished scans and visits are
kept in ``build/study``.
"""

import argparse
import dataclasses
import json
import shutil
import time
from pathlib import Path

import numpy as np
import torch
import yaml

from meshot.anatomy import HEMISPHERES
from meshot.jobs import run_jobs
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.provenance import rounded, write_results
from meshot.study import StudySettings, read_subjects, reconstruct_study, visits_of_bids
from meshot.synth import synthetic_subject
from meshot.synth.cohorts import Recipe, Subject, drawn_shape, make_cohort, read_recipe, scans

HERE = Path(__file__).resolve().parent
PLACE = HERE.parents[1] / "build" / "study"


def main() -> None:
    """Make the scans, reconstruct them, and write the table beside the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=PLACE, help="for scans and surfaces (about 1.5 GB)")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes (default: %(default)s)")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    cohorts = made_cohorts(config, chosen.folder, chosen.jobs)
    labels, partial = labels_of(config), HERE / "partial.jsonl"
    tasks = [
        {"group": group, "participant": scan.participant.participant_id, "session": scan.session}
        for group, found in cohorts.items()
        for scan in found
    ]
    raw, by_name = begin_dataset(chosen.folder / "raw"), {(g, s.name): s for g, found in cohorts.items() for s in found}

    def work(task: dict) -> dict:
        scan = by_name[task["group"], "_".join([task["participant"], f"ses-{task['session']}"])]
        return placed(scan, config, task["group"], labels[task["group"], task["participant"]], raw)

    rows = run_jobs(tasks, work, partial, folder=HERE, config=config, clock=time.process_time)
    people = described_people([row["found"] for row in rows], raw)
    visits = reconstructed(raw, chosen.folder / "surfaces", chosen.jobs)
    seconds = sum(row["seconds"] for row in rows) + sum(visit["seconds"] for visit in visits)
    write_results(
        HERE / "results.json", rounded({"people": people, "visits": visits}), config,
        "python experiments/study/run.py", "synthetic heads made from fsaverage5", seconds,
    )  # fmt: skip
    partial.unlink()


def made_cohorts(config: dict, folder: Path, jobs: int) -> dict[str, list[Subject]]:
    """The finished cohort of each group."""
    for group in config["groups"]:
        for name in make_cohort(recipe_of(config, group), folder / group, jobs):
            print(f"{group} {name}", flush=True)
    return {group: scans(folder / group) for group in config["groups"]}


def recipe_of(config: dict, group: str, **other: float) -> Recipe:
    """The recipe of a group, with other parameters of the shape if they are given."""
    base, chosen = read_recipe(config["recipe"]), config["groups"][group]
    return dataclasses.replace(
        base,
        name=group,
        seed=chosen["seed"],
        subjects=config["people"],
        days=config["visits"],
        scans_per_day=1,
        shape=dict(base.shape) | {"atrophy": chosen["atrophy"]} | other,
        position=dict(base.position) | config["position"],
        registration_mm=config["registration_mm"],
    )


def labels_of(config: dict) -> dict[tuple[str, str], str]:
    """The label of each person, in an order that does not tell the group."""
    people = [(group, f"sub-{i + 1:03d}") for group in config["groups"] for i in range(config["people"])]
    order = np.random.default_rng(config["label_seed"]).permutation(len(people))
    return {people[k]: f"{place + 1:02d}" for place, k in enumerate(order)}


def begin_dataset(raw: Path) -> Path:
    """The folder of the BIDS data set, with its description."""
    raw.mkdir(parents=True, exist_ok=True)
    about = {"Name": "Two groups of synthetic people", "BIDSVersion": "1.10.0", "DatasetType": "raw"}
    (raw / "dataset_description.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return raw


def placed(scan: Subject, config: dict, group: str, label: str, raw: Path) -> dict:
    """Copy a scan into the BIDS data set; the person's true volume and area, with atrophy and without it."""
    participant, session = f"sub-{label}", f"ses-{scan.session}"
    target = raw / participant / session / "anat" / f"{participant}_{session}_T1w.nii.gz"
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(scan.file("T1w.nii.gz"), target)
    facts, found = scan.facts(), {"participant_id": participant, "session_id": session, "group": group}
    found["strength"] = facts["deformation_strength"]
    for side in HEMISPHERES:
        white = facts["surfaces"][f"{side} white"]
        found |= {
            f"{side}_volume_mm3": 1000 * white["volume_ml"],
            f"{side}_area_mm2": 100 * white["area_cm2"],
            f"{side}_thickness_mm": facts["surfaces"][f"{side} thickness_mm"]["median"],
        }
    return found | (without_atrophy(scan, config, group) if config["groups"][group]["atrophy"] else {})


def without_atrophy(scan: Subject, config: dict, group: str) -> dict:
    """Volume and area of the same person's white surfaces if there were no atrophy."""
    shape = drawn_shape(recipe_of(config, group, atrophy=0.0), scan.participant.kind)
    surfaces, found = synthetic_subject(shape, scan.participant.seed), {}
    for side, mesh in surfaces.white.items():
        found[f"{side}_volume_before_mm3"] = float(signed_volume(mesh))
        found[f"{side}_area_before_mm2"] = float(face_areas(mesh).sum())
    return found | {"strength_before": surfaces.strength}


def described_people(rows: list[dict], raw: Path) -> list[dict]:
    """One row for each person, and ``participants.tsv``. The anatomy of both visits is the same."""
    first = {row["participant_id"]: row for row in rows if row["session_id"] == "ses-01"}
    people = [{key: value for key, value in first[name].items() if key != "session_id"} for name in sorted(first)]
    lines = ["participant_id\tgroup", *(f"{person['participant_id']}\t{person['group']}" for person in people)]
    (raw / "participants.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return people


def reconstructed(raw: Path, study: Path, jobs: int) -> list[dict]:
    """The rows of ``subjects.tsv`` after a run of the whole system over the data set."""
    failed = reconstruct_study(visits_of_bids(raw), study, StudySettings(threads=1), jobs, raw)
    if failed:
        raise SystemExit(f"failed: {', '.join(visit.label for visit in failed)}; see {study}")
    return read_subjects(study)


if __name__ == "__main__":
    main()
