"""How near a surface from the true fractions comes to the truth, over the size of the voxels.

Run as ``python experiments/grid_floor/run.py`` when the cohort exists; ``--cohorts`` names the folder that holds it.
Every result is stored, so that a stopped run can be resumed.
"""

import argparse
import functools
import time
from pathlib import Path

import numpy as np
import torch
import yaml

from meshot.jobs import run_jobs
from meshot.mesh import Mesh, topology
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.pipeline import segmented_surface
from meshot.provenance import rounded, write_results
from meshot.synth import Subject, scans
from meshot.volume import Volume, enclosed_fractions

HERE = Path(__file__).resolve().parent
COHORTS = HERE.parents[1] / "build" / "cohorts"
MEASURED = ("assd_mm", "hausdorff90_mm", "assd_mm_raw", "given_up_mm3", "n_faces", "n_voxels", "cpu_seconds")


def grid_around(mesh: Mesh, voxel: float, margin: float) -> Volume:
    """An empty grid of cubic voxels (mm) around a mesh, with a margin (mm)."""
    low, high = (f(mesh.vertices, dim=0).values.numpy() for f in (torch.min, torch.max))
    shape = np.ceil((high - low + 2 * margin) / voxel).astype(int) + 1
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = low - margin
    return Volume(np.zeros(tuple(int(n) for n in shape)), affine)


def measured(truth: Mesh, voxel: float, config: dict) -> dict:
    """The distances of the surface from the true fractions on such a grid, and what it costs."""
    grid = grid_around(truth, voxel, config["margin_mm"])
    fractions, started = enclosed_fractions(truth, grid), time.process_time()
    surface = segmented_surface(grid.with_data(fractions))
    seconds = time.process_time() - started
    n_given_up = int(surface.mask.data.sum()) - int(surface.genus_zero_mask.data.sum())
    there, back = _offsets(surface.mesh, truth, config)
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "assd_mm_raw": average_surface_distance(*_offsets(surface.raw_mesh, truth, config)),
        "given_up_mm3": n_given_up * voxel**3,
        "n_faces": len(surface.mesh.faces),
        "n_voxels": fractions.size,
        "cpu_seconds": seconds,
        "euler_number": topology(surface.mesh).euler_number,
    }


def _offsets(found: Mesh, truth: Mesh, config: dict) -> tuple:
    return offsets_between(Surface(found), Surface(truth), config["n_points"], (config["seed"], config["seed"] + 1))


def summary(rows: list[dict]) -> list[dict]:
    """For every voxel size the mean of each number over the hemispheres, and the standard deviation of the ASSD."""
    found = []
    for voxel in dict.fromkeys(row["voxel_mm"] for row in rows):
        own = [row for row in rows if row["voxel_mm"] == voxel]
        found.append({"voxel_mm": voxel, "n_hemispheres": len(own)})
        found[-1] |= {key: float(np.mean([row[key] for row in own])) for key in MEASURED}
        found[-1]["assd_mm_sd"] = float(np.std([row["assd_mm"] for row in own], ddof=1))
    return found


def exponent(lines: list[dict]) -> float:
    """The slope of the mean ASSD over the voxel size between logarithms, by least squares."""
    sizes, values = (np.log([line[key] for line in lines]) for key in ("voxel_mm", "assd_mm"))
    return float(np.polyfit(sizes, values, 1)[0])


def chosen(subjects: list[Subject], config: dict) -> dict[str, Subject]:
    """The first held-out subjects of the kind that is measured, by name."""
    own = [each for each in subjects if each.participant.kind == config["kind"]]
    return {each.name: each for each in own[: config["n_subjects"]]}


def main(words: list[str] | None = None) -> None:
    """Compute the missing results, then write the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cohorts", type=Path, default=COHORTS, help="the folder that holds the cohort")
    parser.add_argument("--output", type=Path, default=HERE / "results.json", help="where the results go")
    asked = parser.parse_args(words)
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    people = chosen(scans(asked.cohorts / config["cohort"], "test"), config)

    @functools.lru_cache(maxsize=1)
    def truth_of(name: str, side: str) -> Mesh:
        return people[name].surface("white", side)  # in scanner space, in mm

    tasks = [
        {"subject": name, "side": side, "voxel_mm": voxel}
        for name in people for side in config["sides"] for voxel in config["voxel_mm"]
    ]  # fmt: skip
    partial = asked.output.with_name("partial.jsonl")
    found = run_jobs(
        tasks, lambda task: measured(truth_of(task["subject"], task["side"]), task["voxel_mm"], config), partial,
        folder=HERE, config=config | {"made_in": str(asked.cohorts)}, clock=time.process_time,
    )  # fmt: skip
    rows = [row["task"] | row["found"] for row in found]
    lines = summary(rows)
    results = {"hemispheres": rows, "summary": lines, "exponent": exponent(lines)}
    seconds = sum(row["seconds"] for row in found)
    about = f"held-out subjects of the synthetic cohort {config['cohort']}"
    write_results(asked.output, rounded(results), config, "python experiments/grid_floor/run.py", about, seconds)
    partial.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
