"""Measure ``meshot reconstruct`` on held-out heads: Dice, distances, normals and crossing faces of both sides.

The MNI152 average is measured, too.

The cohorts of ``config.yaml`` have to be made first. ``--only people_like`` measures one of them.
"""

import functools
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface, mni152_t1, mni152_white_matter
from meshot.mesh import Mesh, face_areas, self_intersecting_faces
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.model import network_digest
from meshot.pipeline import Reconstruction, TrainedNetworks, load_networks, reconstruct
from meshot.provenance import rounded
from meshot.statistics import mean_interval, paired_interval
from meshot.synth import Subject, scans
from meshot.volume import Volume, dice, enclosed_fractions, transform_points
from meshot_book.tissue import hemisphere_region, restricted, tissue_surface

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def against(mesh: Mesh, target: Mesh, config: dict) -> dict:
    """Average distance both ways, the median from the target to the mesh, and the ratio of the areas."""
    there, back = offsets_between(
        Surface(mesh), Surface(target), config["n_points"], (config["seed"], config["seed"] + 1)
    )
    return {
        "assd_mm": average_surface_distance(there, back),
        "median_from_target_mm": float(np.median(back.distances)),
        "area_ratio": float(face_areas(mesh).sum() / face_areas(target).sum()),
    }


STAGES = ("initial", "final")
MEASURES = ("assd_mm", "hausdorff90_mm", "normals", "crossing_faces", "area_ratio")
OWN = ("dice", "given_up_percent")


def summarised(scans: list[dict], config: dict) -> dict:
    """Rows by cohort and networks, rows by group of the people, and the first networks against the others."""
    plan, (first, *others) = config["plan"], config["networks"]
    people = _of(scans, "people_like", first)
    grouped = {
        name: [s for s in people if all(low <= s["about"][key] < high for key, (low, high) in limits.items())]
        for name, limits in config["groups"].items()
    }
    return {
        "cohorts": [
            {"cohort": cohort, "networks": name} | averaged(_of(scans, cohort, name))
            for cohort, names in plan.items()
            for name in names
        ],
        "groups": [{"group": name} | averaged(part) for name, part in grouped.items() if part],
        "differences": [
            {"cohort": cohort, "against": other}
            | difference(_of(scans, cohort, first), _of(scans, cohort, other), config["allowed_mm"][other])
            for other in others
            for cohort, names in plan.items()
            if {first, other} <= set(names)
        ],
    }


def _of(scans: list[dict], cohort: str, networks: str) -> list[dict]:
    return [scan for scan in scans if scan["subject"].split("/")[0] == cohort and scan["networks"] == networks]


def averaged(scans: list[dict]) -> dict:
    """Means over the scans of the means of both sides, and the worst side; warnings and seconds."""
    sides = [side for scan in scans for side in scan["sides"].values()]
    found = {"n_scans": len(scans), "least_dice": min(side["dice"] for side in sides)}
    found |= {name: _mean(scans, lambda side, name=name: side[name]) for name in OWN}
    for stage in STAGES:
        found[stage] = {name: _mean(scans, lambda side, at=(stage, name): side[at[0]][at[1]]) for name in MEASURES}
        found[stage]["largest_assd_mm"] = max(side[stage]["assd_mm"] for side in sides)
    found["n_with_warnings"] = sum(bool(scan["warning_names"]) for scan in scans)
    return found | {"cpu_seconds": float(np.mean([scan["cpu_seconds"] for scan in scans]))}


def per_scan(scans: list[dict], value: Callable[[dict], float]) -> list[float]:
    """The mean of a number over the two sides of each scan."""
    return [float(np.mean([value(side) for side in scan["sides"].values()])) for scan in scans]


def _mean(scans: list[dict], value: Callable[[dict], float]) -> dict[str, float | None]:
    values = per_scan(scans, value)
    interval = mean_interval(values) if len(values) > 1 else (values[0], None, None)
    return dict(zip(("mean", "low", "high"), interval))


def difference(first: list[dict], second: list[dict], allowed: float) -> dict:
    """First minus second networks, paired over the scans: ASSD of the final surface in mm."""
    one, other = ({scan["subject"]: scan for scan in scans} for scans in (first, second))
    if set(one) != set(other):
        raise ValueError("the two sets of networks were measured on different scans; measure both on all of them")
    values = [per_scan([rows[name] for name in one], lambda side: side["final"]["assd_mm"]) for rows in (one, other)]
    gap, low, high = paired_interval(*values)
    return {"n_scans": len(one), "assd_mm": {"mean": gap, "low": low, "high": high}, "holds": gap <= allowed}


#: Options that replace the networks of the package.
NETWORKS = {
    "segmentation": ("--segmentation", {"help": "weights in place of the package's"}),
    "weights": ("--weights", {"help": "folder of flows in place of the package's"}),
}


def measured(subject: Subject, networks: TrainedNetworks, config: dict) -> dict:
    """All numbers of one scan."""
    made = reconstruct(subject.scan(), networks.segmentation, networks.system)
    sides = {side: of_side(made, subject.surface("white", side), side, config) for side in HEMISPHERES}
    names = [warning.name for warning in made.warnings]
    seconds = sum(made.cpu_seconds.values())
    return {"about": about(subject), "sides": sides, "warning_names": names, "cpu_seconds": seconds}


def of_side(made: Reconstruction, truth: Mesh, side: Hemisphere, config: dict) -> dict:
    """Numbers of one hemisphere; distances in mm, in scanner space."""
    found = made.surfaces[side]
    standard = truth.with_vertices(transform_points(made.scan.to_standard, truth.vertices.double()))
    mask = found.segmented.mask
    n_mask, n_ball = (int(each.data.sum()) for each in (mask, found.segmented.genus_zero_mask))
    repaired = found.repaired
    return {
        "dice": dice(uncropped(mask, made.scan.volume), enclosed_fractions(standard, made.scan.volume) > 0.5),
        "given_up_percent": 100 * (n_mask - n_ball) / n_mask,
        "crossing_faces_before_repair": None if repaired is None else repaired.n_crossing,
        "initial": compared(found.initial, truth, config),
        "final": compared(found.final, truth, config),
    }


def uncropped(mask: Volume, grid: Volume) -> np.ndarray:
    """A mask of a part of a grid, on the whole grid."""
    first = np.rint(np.linalg.inv(grid.affine) @ mask.affine[:, 3]).astype(int)[:3]
    whole = np.zeros(grid.data.shape, dtype=bool)
    whole[tuple(slice(start, start + n) for start, n in zip(first, mask.data.shape))] = mask.data
    return whole


def compared(mesh: Mesh, truth: Mesh, config: dict) -> dict:
    """Metrics between a surface and the true one."""
    there, back = offsets_between(
        Surface(mesh), Surface(truth), config["n_points"], (config["seed"], config["seed"] + 1)
    )
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "normals": normal_agreement(there, back),
        "crossing_faces": len(self_intersecting_faces(mesh)),
        "area_ratio": float(face_areas(mesh).sum() / face_areas(truth).sum()),
    }


def about(subject: Subject) -> dict:
    """Factor on the ventricles, which grows with age; cube root of the volume of a voxel; 1 with skull, 0 without."""
    knobs = subject.facts()["knobs"]
    return {
        "ventricles": knobs["anatomy"]["ventricles"],
        "voxel_mm": float(np.prod(knobs["position"]["voxel_mm"]) ** (1 / 3)),
        "skull": int(bool(knobs["anatomy"]["head_mm"])),
    }


@functools.cache
def networks(name: str, config: dict) -> TrainedNetworks:
    """The networks of a row of the plan."""
    package = {"segmentation": config.get("segmentation"), "weights": config.get("weights")}
    return load_networks(**(config["networks"] | {"package": package})[name], white_only=True)


@functools.cache
def used(config: dict) -> dict[str, dict[str, str]]:
    """The digests of all networks."""
    found = {}
    for name in config["networks"]:
        own = networks(name, config)
        found[name] = {"segmentation": network_digest(own.segmentation)}
        found[name] |= {part: network_digest(each.network) for part, each in own.system.parts.items()}
    return found


@functools.cache
def subjects(config: dict) -> dict[str, Subject]:
    """The held-out scans of all cohorts."""
    return {
        f"{cohort}/{subject.name}": subject
        for cohort, folder in config["cohorts"].items()
        for subject in scans(folder, config["split"])
        if subject.participant.kind == config["kind"]
    }


def tasks(config: dict) -> list[dict]:
    """All scans with the networks that are planned for their cohort."""
    return [
        {"subject": name, "networks": which, "digests": used(config)[which]}
        for name in subjects(config)
        for which in config["plan"][name.split("/")[0]]
    ]


def work(task: dict, config: dict) -> dict:
    """All numbers of one scan."""
    return measured(subjects(config)[task["subject"]], networks(task["networks"], config), config)


def results(rows: list[dict], config: dict) -> dict:
    """The scans, their summary, and the average."""
    scanned = [{"subject": row["task"]["subject"], "networks": row["task"]["networks"]} | row["found"] for row in rows]
    package = networks("package", config)
    made, average = reconstruct(mni152_t1(), package.segmentation, package.system), {}
    for side in HEMISPHERES:
        # The surface of the white-matter map within the region of chapter 23, where it is one half.
        white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
        region = hemisphere_region(mni152_t1(), white, pial, side)
        target, surfaces = tissue_surface(restricted(mni152_white_matter(), region)).mesh, made.surfaces[side]
        average[side] = {stage: against(getattr(surfaces, stage), target, config) for stage in STAGES}
    summary = summarised(scanned, config)
    return rounded({"networks": used(config), "summary": summary, "average": average, "scans": scanned})


def data(config: dict) -> str:
    """The cohorts."""
    return f"held-out subjects of the synthetic cohorts {', '.join(config['cohorts'])}"


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, data, NETWORKS)
