"""Choose the warnings of a reconstruction on held-out heads, good and deliberately spoiled.

``config.yaml`` holds the protocol. Each head takes about two minutes of one core: half a minute to make it, and two
reconstructions. ``results.json`` has the limits, both shares with their intervals, and a row for every reconstruction.
"""

import dataclasses
import functools
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.ndimage
import scipy.stats
from scipy.spatial import cKDTree

from meshot.anatomy import HEMISPHERES, Hemisphere, enlarged, fsaverage5_surface, mni152_t1
from meshot.mesh import Mesh
from meshot.metrics import Surface, average_surface_distance, offsets_between, vertex_distances
from meshot.model import network_digest
from meshot.pipeline import (
    LOBES,
    TrainedNetworks,
    load_networks,
    lobe_numbers,
    quality_numbers,
    reconstruct,
    template_places,
)
from meshot.provenance import read_results, rounded
from meshot.synth import LABELS, Recipe, Subject, make_cohort, read_recipe, scans
from meshot.types import Array
from meshot.volume import Volume, transform_points, voxel_sizes

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

WHITE = [LABELS["left white"], LABELS["right white"]]
GREY = [LABELS["left grey"], LABELS["right grey"]]
AIR = 0


# Spoiled scans. Each function returns the scan, and the affine from the scanner's space to that of the spoiled scan.


def inverted(scan: Volume, labels: Array, rng: np.random.Generator) -> tuple[Volume, Array]:
    """All intensities of the head inverted."""
    head = labels != AIR
    high = 1.1 * np.percentile(scan.data[head], 99.5)
    return scan.with_data(np.where(head, np.maximum(high - scan.data, 0), scan.data)), np.eye(4)


def bright_fluid(scan: Volume, labels: Array, rng: np.random.Generator) -> tuple[Volume, Array]:
    """Fluid mirrored at white matter, so that it is brightest."""
    white = np.median(scan.data[np.isin(labels, WHITE)])
    return scan.with_data(np.where(labels == LABELS["fluid"], 2 * white - scan.data, scan.data)), np.eye(4)


def one_side(scan: Volume, labels: Array, rng: np.random.Generator) -> tuple[Volume, Array]:
    """Air in place of all that is nearer to the right hemisphere than to the left one."""
    left, right = (
        scipy.ndimage.distance_transform_edt(
            ~np.isin(labels, [LABELS[f"{side} white"], LABELS[f"{side} grey"]]), sampling=voxel_sizes(scan)
        )
        for side in HEMISPHERES
    )
    return scan.with_data(np.where(right < left, scan.data.min(), scan.data)), np.eye(4)


def cropped(scan: Volume, labels: Array, rng: np.random.Generator, mm: float) -> tuple[Volume, Array]:
    """Air above a height in the scanner."""
    heights = np.tensordot(scan.affine[2, :3], np.indices(scan.data.shape), 1) + scan.affine[2, 3]
    limit = heights[np.isin(labels, WHITE)].max() - mm
    return scan.with_data(np.where(heights > limit, scan.data.min(), scan.data)), np.eye(4)


def biased(
    scan: Volume, labels: Array, rng: np.random.Generator, of_logarithm: float, mm: float
) -> tuple[Volume, Array]:
    """The scan times a smooth field, whose logarithm has this standard deviation over the head."""
    field = scipy.ndimage.gaussian_filter(rng.standard_normal(scan.data.shape), mm / voxel_sizes(scan))
    field -= field[labels != AIR].mean()
    return scan.with_data(scan.data * np.exp(of_logarithm * field / field[labels != AIR].std())), np.eye(4)


def noisy(scan: Volume, labels: Array, rng: np.random.Generator, of_contrast: float) -> tuple[Volume, Array]:
    """Noise added, in units of the difference between white and grey matter."""
    white, grey = (np.median(scan.data[np.isin(labels, each)]) for each in (WHITE, GREY))
    added = of_contrast * (white - grey) * rng.standard_normal(scan.data.shape)
    return scan.with_data(np.maximum(scan.data + added, 0)), np.eye(4)


def thick(scan: Volume, labels: Array, rng: np.random.Generator, mm: float) -> tuple[Volume, Array]:
    """Means over slices that are this thick along the third axis of the voxels."""
    n = max(round(mm / voxel_sizes(scan)[2]), 1)
    kept = scan.data.shape[2] // n * n
    data = scan.data[:, :, :kept].reshape(*scan.data.shape[:2], -1, n).mean(axis=3)
    affine = scan.affine.copy()
    affine[:3, 3] += (n - 1) / 2 * affine[:3, 2]
    affine[:3, 2] *= n
    return Volume(data, affine), np.eye(4)


def turned(scan: Volume, labels: Array, rng: np.random.Generator) -> tuple[Volume, Array]:
    """A header that is wrong: half a turn about the axis from left to right."""
    turn = np.diag([1.0, -1.0, -1.0, 1.0])
    return Volume(scan.data, turn @ scan.affine), turn


def lesion(scan: Volume, labels: Array, rng: np.random.Generator, mm: float) -> tuple[Volume, Array]:
    """A ball of fluid whose centre is in white matter, as far from its border as half of it at most."""
    depths = scipy.ndimage.distance_transform_edt(np.isin(labels, WHITE), sampling=voxel_sizes(scan))
    places = np.argwhere(depths > np.quantile(depths[depths > 0], 0.5))
    offsets = (np.indices(scan.data.shape).T - rng.choice(places)) * voxel_sizes(scan)
    ball = (np.linalg.norm(offsets, axis=-1) < mm).T & (labels != AIR)
    fluid = scan.data[labels == LABELS["fluid"]]
    return scan.with_data(np.where(ball, rng.choice(fluid, scan.data.shape), scan.data)), np.eye(4)


def vessels(scan: Volume, labels: Array, rng: np.random.Generator, of_fluid: float) -> tuple[Volume, Array]:
    """Parts of the fluid far brighter than white matter, as with gadolinium."""
    fluid, white = labels == LABELS["fluid"], np.median(scan.data[np.isin(labels, WHITE)])
    field = scipy.ndimage.gaussian_filter(rng.standard_normal(scan.data.shape), 2.0 / voxel_sizes(scan))
    bright = fluid & (field > np.quantile(field[fluid], 1 - of_fluid))
    return scan.with_data(np.where(bright, 1.6 * white, scan.data)), np.eye(4)


def child(scan: Volume, labels: Array, rng: np.random.Generator, factor: float) -> tuple[Volume, Array]:
    """The whole head smaller by a factor."""
    smaller = np.diag([factor, factor, factor, 1.0])
    return Volume(scan.data, smaller @ scan.affine), smaller


KINDS: dict[str, Callable[..., tuple[Volume, Array]]] = {
    "inverted": inverted, "bright_fluid": bright_fluid, "one_side": one_side, "cropped": cropped,
    "biased": biased, "noisy": noisy, "thick": thick, "turned": turned,
    "lesion": lesion, "vessels": vessels, "child": child,
}  # fmt: skip


def spoiled(subject: Subject, how: dict, seed: int) -> tuple[Volume, Array]:
    """A scan spoiled in one way of ``config.yaml``, and the affine from the scanner's space to its own."""
    sizes = {name: value for name, value in how.items() if name != "kind"}
    scan = subject.scan()
    scan = scan.with_data(scan.data.astype(np.float32))
    made, moved = KINDS[how["kind"]](scan, subject.tissue().data, np.random.default_rng(seed), **sizes)
    return made.with_data(made.data.astype(np.float32)), moved


# The heads, and one reconstruction.


def recipe_of(config: dict, n_heads: int) -> Recipe:
    """The recipe of the heads; a larger number of heads leaves the first ones as they are."""
    return dataclasses.replace(
        read_recipe(config["recipe"]),
        name="warnings",
        seed=config["seed"],
        subjects=n_heads,
        split={"train": 0.0, "validation": 0.0, "test": 1.0},
        registration_mm=config["registration_mm"],
        standard="grey values",
    )


def head(number: int, config: experiment.Config) -> Subject:
    """A head, made if it is missing."""
    folder = config.place.with_name("heads")
    for _ in make_cohort(recipe_of(config, number + 1), folder):
        pass
    return scans(folder)[number]


@functools.cache
def networks_of(config: dict) -> TrainedNetworks:
    """The networks of the package."""
    return load_networks(white_only=True)


def measured(scan: Volume, subject: Subject, moved: Array, config: dict) -> dict:
    """Numbers, warnings and the distance from the truth of one reconstruction; or why it was refused."""
    networks = networks_of(config)
    try:
        made = reconstruct(scan, networks.segmentation, networks.system)
    except ValueError as error:
        return {"refused": str(error)}
    distances, lobes = {}, lobe_numbers(made, scan)
    for side in HEMISPHERES:
        truth, found = subject.surface("white", side), made.surfaces[side].final
        truth = truth.with_vertices(transform_points(moved, truth.vertices.double()))
        offsets = offsets_between(Surface(found), Surface(truth), config["n_points"], (0, 1))
        distances[side] = average_surface_distance(*offsets)
        for lobe, away in by_lobe(found, truth, side).items():
            lobes[side][lobe]["distance_mm"] = away
    return {
        "assd_mm": distances,
        "lobes": lobes,
        "numbers": quality_numbers(scan, made.scan, enlarged(mni152_t1()), made.surfaces),
        "warning_names": [warning.name for warning in made.warnings],
        "cpu_seconds": sum(made.cpu_seconds.values()),
    }


def by_lobe(found: Mesh, truth: Mesh, side: Hemisphere) -> dict[str, float]:
    """The mean distance between a surface and the truth by lobe, in mm, in the worse direction.

    The first vertices of a true surface are those of fsaverage5, whose lobes are known.
    """
    known = truth.vertices[: len(fsaverage5_surface("white", side).vertices)]
    _, lobes = template_places(fsaverage5_surface("white", side, "MNI152"), side)
    nearest = cKDTree(known.numpy()).query(found.vertices.double().numpy())[1]
    there = vertex_distances(found, truth)
    back = vertex_distances(truth, found)[: len(known)]
    means = {}
    for index, lobe in enumerate(LOBES):
        parts = (there[lobes[nearest] == index], back[lobes == index])
        means[lobe] = max(float(each.mean()) for each in parts if len(each))
    return means


# Limits, and what they are worth.


def limits_of(
    good: list[dict], bad: dict[str, str], margin: float = 1.0
) -> dict[str, tuple[float | None, float | None]]:
    """The lowest and the highest value without a warning, by number: None where there is no limit.

    ``margin`` is the part of the range by which the extremes are moved.
    """
    found = {}
    for name, direction in bad.items():
        values = [numbers[name] for numbers in good]
        low, high = min(values), max(values)
        width = margin * (high - low)
        found[name] = (
            low - width if direction in ("low", "either") else None,
            high + width if direction in ("high", "either") else None,
        )
    return found


def beyond(numbers: dict[str, float], limits: dict[str, tuple[float | None, float | None]]) -> list[str]:
    """The names of the numbers that lie beyond their limits. What is no number lies beyond every limit."""
    found = []
    for name, (low, high) in limits.items():
        value = numbers[name]
        inside = np.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)
        if not inside:
            found.append(name)
    return found


def share(warned: list[bool]) -> dict:
    """A share with its exact 95 % interval."""
    if not warned:
        return {"warned": 0, "of": 0, "share": None, "low": None, "high": None}
    test = scipy.stats.binomtest(sum(warned), len(warned))
    interval = test.proportion_ci(method="exact")
    return {
        "warned": sum(warned), "of": len(warned), "share": sum(warned) / len(warned),
        "low": float(interval.low), "high": float(interval.high),
    }  # fmt: skip


def judged(rows: list[dict], config: dict) -> dict:
    """Limits from the first heads, or from those of an earlier run, and the shares of warnings on the others."""
    if "choice" in config:
        earlier = read_results(config["choice"])["results"]["rows"]
        rows = [row | {"head": row["head"] - len(earlier)} for row in earlier] + rows
    parts = {
        half: {key: [row for row in rows if row["spoiled"] == flag and (row["head"] < config["n_choice"]) == first]
               for key, flag in (("good", False), ("spoiled", True))}
        for half, first in (("choice", True), ("judgement", False))
    }  # fmt: skip
    choice = parts["choice"]
    all_limits = limits_of([row["numbers"] for row in choice["good"] if "numbers" in row], config["bad"])
    seen = {name for row in choice["spoiled"] if "numbers" in row for name in beyond(row["numbers"], all_limits)}
    limits = {name: each for name, each in all_limits.items() if name in seen}

    def useful(row: dict) -> bool:
        return "assd_mm" in row and max(row["assd_mm"].values()) <= config["useful_mm"]

    counted = {}
    for half, kinds in parts.items():
        for key, each in kinds.items():
            for part, wanted in (("all", each), ("counted", [row for row in each if useful(row) == (key == "good")])):
                counted[f"{half}, {key}, {part}"] = {
                    "new": share(["refused" in row or bool(beyond(row["numbers"], limits)) for row in wanted]),
                    "before": share(["refused" in row or bool(row["warning_names"]) for row in wanted]),
                }
    found = {"limits": limits, "dropped": sorted(set(all_limits) - set(limits)), "shares": counted}
    return found | ({"lobes": judged_lobes(parts, useful, config)} if "bad_of_lobes" in config else {})


def judged_lobes(parts: dict, useful: Callable[[dict], bool], config: dict) -> dict:
    """The limits of the numbers of lobes, and what doubts about lobes are worth on the heads of the judgement."""

    def lobes_of(row: dict) -> list[dict]:
        return [lobe for side in row.get("lobes", {}).values() for lobe in side.values()]

    chosen = [lobe for row in parts["choice"]["good"] for lobe in lobes_of(row)]
    limits = limits_of(chosen, config["bad_of_lobes"], config["margin_of_lobes"])
    judgement = parts["judgement"]
    wanted = {
        "good": [row for row in judgement["good"] if useful(row)],
        "spoiled": [row for row in judgement["spoiled"] if "refused" not in row and not useful(row)],
    }
    shares = {
        f"{name} heads": share([any(beyond(lobe, limits) for lobe in lobes_of(row)) for row in rows])
        for name, rows in wanted.items()
    }
    every = [lobe for rows in judgement.values() for row in rows for lobe in lobes_of(row)]
    for name, chosen in (
        ("wrong lobes", [lobe for lobe in every if lobe["distance_mm"] > config["wrong_lobe_mm"]]),
        ("right lobes", [lobe for lobe in every if lobe["distance_mm"] <= config["wrong_lobe_mm"]]),
        ("lobes of good heads", [lobe for row in wanted["good"] for lobe in lobes_of(row)]),
    ):
        shares[name] = share([bool(beyond(lobe, limits)) for lobe in chosen])
    return {"limits": limits, "shares": shares}


def tasks(config: dict) -> list[dict]:
    """Each head as it is, and spoiled in turn; or each head in every way."""
    digests = digests_of(config)
    if config.get("every"):
        ways = range(len(config["spoiled"]))
        return [{"head": k, "way": way, "digests": digests} for k in range(config["n_heads"]) for way in ways]
    return [
        {"head": number, "spoiled": flag, "digests": digests}
        for number in range(config["n_heads"])
        for flag in (False, True)
    ]


@functools.cache
def digests_of(config: dict) -> dict[str, str]:
    """Of the networks."""
    networks = networks_of(config)
    parts = {"segmentation": networks.segmentation} | {k: p.network for k, p in networks.system.parts.items()}
    return {name: network_digest(each) for name, each in parts.items()}


def work(task: dict, config: experiment.Config) -> dict:
    """One reconstruction."""
    subject, number = head(task["head"], config), task["head"]
    if not task.get("spoiled", True):
        return rounded(measured(subject.scan(), subject, np.eye(4), config))
    how = config["spoiled"][task.get("way", number % len(config["spoiled"]))]
    scan, moved = spoiled(subject, how, config["seed"] + number)
    return rounded({"kind": how["kind"]} | measured(scan, subject, moved, config))


def outcome(row: dict, config: dict) -> str:
    """What becomes of a scan: refused, warned of, right, or wrong without a word."""
    if "refused" in row:
        return "refused"
    if row["warning_names"]:
        return "warned of"
    return "right" if max(row["assd_mm"].values()) <= config["useful_mm"] else "wrong without a word"


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The judgement, and all rows; or the outcome of each way."""
    if config.get("every"):
        tried, outcomes = [], {}
        for row in rows:
            how, found = config["spoiled"][row["task"]["way"]], row["found"]
            tried.append({"head": row["task"]["head"], "outcome": outcome(found, config)} | how | found)
            outcomes.setdefault(" ".join(map(str, how.values())), []).append(tried[-1]["outcome"])
        return rounded({"networks": digests_of(config), "outcomes": outcomes, "rows": tried})
    found = [{"head": row["task"]["head"], "spoiled": row["task"]["spoiled"]} | row["found"] for row in rows]
    return rounded({"networks": digests_of(config)} | judged(found, config) | {"rows": found})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "held-out heads of the recipe people_like, with another seed")
