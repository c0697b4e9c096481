"""Store the surfaces that all systems find in two held-out subjects, for the pictures of the chapter.

Run as ``python experiments/comparison/pictures.py`` when ``run.py`` has measured the systems. The subjects are those
with the median and with the largest ASSD of a column, in the mean over some of the systems. The surfaces are
simplified. Their values are the distances of the whole surfaces from the true one, in mm.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

from meshot.mesh import Mesh, simplified
from meshot.metrics import vertex_distances
from meshot_book.notebook import write_meshes

sys.path.append(str(Path(__file__).resolve().parents[1]))
from run import Setting, setting_of
from tables import MAIN, SUBJECTS, measured

from trials.rows import read_rows
from trials.scanned import INITIAL, reconstructed
from trials.training import FIRST_SEED, STEPS, arguments, finals, read_config

TRUE = "true"


def chosen_subjects(rows: list[dict], place: dict) -> dict[str, str]:
    """The subjects with the median and the largest mean ASSD over the systems of the place: "median" and "worst"."""
    values: dict[str, list[float]] = {}
    for row in (row for row in measured(rows) if row["arm"] in place["chosen_by"]):
        column = (row["cohort"], row["side"], row["kind"], row["budget"], row["seed"])
        if column == (place["cohort"], place["side"], MAIN, STEPS, FIRST_SEED):
            values.setdefault(row["subject"], []).append(row["assd_mm"])
    order = sorted(values, key=lambda subject: float(np.mean(values[subject])))
    if not order:
        raise ValueError(f"no system is measured on the {place['side']} side of {place['cohort']}: run run.py first")
    return {"median": order[(len(order) - 1) // 2], "worst": order[-1]}


def pictured(mesh: Mesh, truth: Mesh, n_faces: int) -> tuple[Mesh, np.ndarray]:
    """A simplified surface, and for each of its vertices the distance of the nearest vertex of the whole surface."""
    small, distances = simplified(mesh, n_faces), vertex_distances(mesh, truth)
    _, nearest = cKDTree(mesh.vertices.double().numpy()).query(small.vertices.double().numpy())
    return small, np.asarray(distances)[nearest]


def surfaces_of(subject: str, place: dict, setting: Setting) -> dict[str, Mesh]:
    """The surfaces of one side by system, with the initial and the true one. Surfaces not found are left out."""
    scan, side = setting.seen(setting.subjects[place["cohort"]][subject]), place["side"]
    found = {INITIAL: reconstructed(scan, None)[0][side]}
    for name, unit in setting.there.items():
        wanted = unit.is_first and unit.cohort == place["cohort"]
        surfaces = reconstructed(scan, setting.system(name))[0] if wanted and side in unit.sides else {}
        if isinstance(surfaces, dict) and side in surfaces:
            found[unit.arm] = surfaces[side]
    return found | {TRUE: scan.truths[side]}


def main(words: list[str] | None = None) -> int:
    """Write the file."""
    folder = Path(__file__).parent
    parser = arguments(__doc__, folder, "pictures.safetensors.gz")
    parser.add_argument("--rows", type=Path, default=folder / SUBJECTS, help="the rows of all subjects")
    asked = parser.parse_args(words)
    config = read_config(asked.config)
    torch.set_num_threads(config["evaluation"]["n_threads"])
    place = config["pictures"]
    setting = setting_of(config, asked.config, [unit for unit in finals(config) if unit.is_made(config)])
    meshes, values = {}, {}
    for which, subject in chosen_subjects(read_rows(asked.rows), place).items():
        found = surfaces_of(subject, place, setting)
        for name, mesh in found.items():
            key = f"{which}/{subject}/{name}"
            meshes[key], values[key] = pictured(mesh, found[TRUE], place["n_faces"])
    write_meshes(asked.output, meshes, place["step_mm"], values)
    return 0


if __name__ == "__main__":
    sys.exit(main())
