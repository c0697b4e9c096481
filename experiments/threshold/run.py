"""When a fall of the paper's loss brings a surface nearer: fits and trainings, and what their start predicts.

Run as ``python experiments/threshold/run.py``, on one thread, when the cohorts of ``config.yaml``, the protocol, exist;
some six hours. A fit and a training resume from their last state.

``results.json`` has a row for every trajectory under "trajectories": its start, the loss and the ASSD (mm) at every
check, the local share, and whether it agrees with the predictions; and under "predictions" what the protocol asks.
"""

import functools
import sys
from pathlib import Path

import numpy as np
import scipy.stats
import torch
from scipy.spatial import KDTree

from meshot.flow import FitSettings, GridVelocity, fit_flow, grid_around, integrate, sliced_loss
from meshot.loss import quasi_directions, sliced_wasserstein
from meshot.measure import DiscreteMeasure, varifold
from meshot.mesh import Mesh, neighbour_means, simplified
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.model import network_digest
from meshot.pipeline import InitialSurfaces
from meshot.provenance import rounded
from meshot.synth import read_subject
from meshot.systems import DeformationExample, get_system, hemisphere_example, read_settings, train_deformation
from meshot_book.trainings import curve

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

from trials.training import segmentation_network

FIT, NETWORK = "fit", "network"


def tasks(config: dict) -> list[dict]:
    """All trajectories: fits from each start with each length of the normals, coarser ones, and networks."""
    subjects = [{"cohort": cohort, "subject": name} for name in config["subjects"] for cohort in config["cohorts"]]
    usual = {"n_faces": config["n_faces"], "finest_mm": config["finest_mm"]}
    scales = config["normal_scales"]
    found = [
        subject | {"by": FIT, "start": start, "normal_scale": scale} | usual
        for subject in subjects for start in config["starts"] for scale in scales
    ]  # fmt: skip
    first = subjects[: len(config["cohorts"])]
    coarse = {"by": FIT, "start": "initial", "normal_scale": 20.0}
    found += [subject | coarse | size for subject in first for size in config["coarser"]]
    learned = {"by": NETWORK, "start": "initial"} | usual
    return found + [subject | learned | {"normal_scale": scale} for subject in first for scale in scales]


@functools.lru_cache(maxsize=1)
def example_of(cohort: str, subject: str, config: experiment.Config) -> DeformationExample:
    """The hemisphere of one subject, in standard space."""
    surfaces, keys = InitialSurfaces(config["initial"], segmentation_network(config)), [(config["side"], "white")]
    example = surfaces.example(read_subject(config["cohorts"][cohort], subject), keys, keys)
    return hemisphere_example(example, config["side"], config["n_faces"])


def assd(mesh: Mesh, truth: Surface, config: dict) -> float:
    """The average symmetric distance of a surface from the true one, in mm."""
    found = Surface(mesh.with_vertices(mesh.vertices.detach().double()))
    return average_surface_distance(
        *offsets_between(found, truth, config["n_points"], (config["seed"], config["seed"] + 1))
    )


def start_of(kind: str, example: DeformationExample, truth: Surface, config: dict) -> Mesh:
    """A start with the ASSD of the initial surface."""
    if kind == "initial":
        return example.initial
    wanted, mesh = assd(example.initial, truth, config), example.target
    if kind == "smoothed":
        while assd(mesh, truth, config) < wanted:
            mesh = mesh.with_vertices((mesh.vertices + neighbour_means(mesh)) / 2)
        return mesh
    settings = config["displacement"]
    field = grid_around(mesh.vertices, spacings=(settings["spacing"],), n_pieces=1, margin=config["grid"]["margin"])
    drawn = np.random.default_rng(config["seed"]).normal(size=tuple(field.levels[0].shape))
    drawn = torch.from_numpy(drawn).to(mesh.vertices)

    def displaced(length: float) -> Mesh:
        with torch.no_grad():
            field.levels[0].copy_(length * drawn)
            return mesh.with_vertices(integrate(field, mesh.vertices, settings["n_steps"]))

    low, high = 0.0, 8 * wanted
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (middle, high) if assd(displaced(middle), truth, config) < wanted else (low, middle)
    return displaced((low + high) / 2)


def loss_between(source: DiscreteMeasure, target: DiscreteMeasure, config: dict) -> float:
    """The sliced loss along many directions, always the same."""
    lines = quasi_directions(config["n_directions"], source.points.shape[1], config["seed"]).to(source.points)
    return float(sliced_wasserstein(source, target, lines))


def balanced(source: DiscreteMeasure, target: DiscreteMeasure) -> DiscreteMeasure:
    """The source with the masses of the target: each support gives its mass to the nearest one of the source."""
    _, nearest = KDTree(source.points.numpy()).query(target.points.numpy())
    masses = np.bincount(nearest, target.weights.numpy(), len(source.points))
    return DiscreteMeasure(source.points, torch.from_numpy(masses).to(source.weights))


def encoded(mesh: Mesh, scale: float) -> DiscreteMeasure:
    """The varifold of a mesh, in double precision and without gradient."""
    return varifold(mesh.with_vertices(mesh.vertices.detach().double()), normal_scale=scale)


def fitted(task: dict, start: Mesh, target: Mesh, truth: Surface, config: experiment.Config) -> dict:
    """The checks of a fit of a flow to the loss of DDOT."""
    settings, scale = dict(config["fit"]), task["normal_scale"]
    spacings = tuple(each for each in config["grid"]["spacings"] if each >= task["finest_mm"])
    grid = {key: config["grid"][key] for key in ("margin", "n_pieces")}
    field: GridVelocity = grid_around(start.vertices, target.vertices, spacings=spacings, **grid)
    loss = sliced_loss(target, lambda mesh: varifold(mesh, normal_scale=scale))
    goal = encoded(target, scale)

    def watch(mesh: Mesh) -> dict[str, float]:
        return {"assd_mm": assd(mesh, truth, config), "sliced": loss_between(encoded(mesh, scale), goal, config)}

    settings["n_directions"] = tuple(settings["n_directions"])
    fit = fit_flow(
        field, start, loss, FitSettings(**settings, seed=config["seed"], save_every=50),
        config.place / f"{name_of(task)}.safetensors", watch=watch,
    )  # fmt: skip
    return {key: fit.history[key] for key in ("checked_iteration", "assd_mm", "sliced")}


def learned(task: dict, example: DeformationExample, config: experiment.Config) -> dict:
    """The checks of a network that learns one subject: the loss is the mean since the previous check."""
    plan = {
        "side": config["side"], "n_epochs": config["networks"]["n_steps"], "n_points": config["n_points"],
        "learning_rate": config["networks"]["learning_rate"], "seed": config["seed"],
        "validate_every": config["networks"]["validate_every"],
    }  # fmt: skip
    changes = [
        *(f"training.{name}={value}" for name, value in plan.items()),
        f"loss.normal_scale={task['normal_scale']}",
    ]
    settings = read_settings(get_system("ddot"), "small", changes)
    log = train_deformation(settings, [example], [example], config.place / name_of(task)).log
    found = curve(log)
    return {"checked_iteration": found["step"], "assd_mm": found["assd_mm"], "sliced": found["loss"]}


def name_of(task: dict) -> str:
    """The name of the files of a task."""
    return "_".join(f"{value}" for value in task.values())


def work(task: dict, config: experiment.Config) -> dict:
    """One trajectory, with the share of its start."""
    torch.use_deterministic_algorithms(True)
    example, scale = example_of(task["cohort"], task["subject"], config), task["normal_scale"]
    target = simplified(example.target, task["n_faces"])
    # Networks are checked in standard space against the whole truth, fits too.
    truth = Surface(example.target.with_vertices(example.target.vertices.double()))
    whole = start_of(task["start"], example, truth, config)
    start = example.coarse if task["by"] == NETWORK else simplified(whole, task["n_faces"]).to(torch.float32)
    source, goal = encoded(start, scale), encoded(example.target if task["by"] == NETWORK else target, scale)
    before, masses = loss_between(source, goal, config), balanced(source, goal)
    shares = {
        "local": loss_between(masses, goal, config) / before,
        "masses": loss_between(source, masses, config) / before,
    }
    begun = {"assd_mm": assd(start, truth, config), "sliced": before}
    course = learned(task, example, config) if task["by"] == NETWORK else fitted(task, start, target, truth, config)
    segmentation = network_digest(segmentation_network(config))
    return rounded({"shares": shares, "before": begun, "segmentation_sha256": segmentation} | course)


def judged(row: dict) -> dict:
    """Whether a trajectory agrees with predictions 1 and 2, and where it crosses."""
    found, share = row["found"], row["found"]["shares"]["local"]
    q = np.array(found["sliced"]) / found["before"]["sliced"]
    r = np.array(found["assd_mm"]) / found["before"]["assd_mm"]
    if share >= 0.5:
        agrees = bool((r <= 1.05).all())
    else:
        spoken = [(r > 1)[(2 * share < q) & (q < 0.9)], (r < 1)[q < share / 2]]
        parts = [float(part.mean()) for part in spoken if len(part)]
        agrees = all(part >= 0.9 for part in parts) if parts else None
    late = int(np.flatnonzero(r >= 1)[-1]) + 1 if (r >= 1).any() else 0
    crossing = float(q[late]) if 0 < late < len(q) else None
    return row["task"] | found | {"agrees": agrees, "crossing": crossing, "end": [float(q[-1]), float(r[-1])]}


def results(rows: list[dict], config: dict) -> dict:
    """All trajectories, and what the predictions ask for."""
    found = [judged(row) for row in rows]
    crossed = [row for row in found if row["crossing"] is not None and row["shares"]["local"] < 0.5]
    q, share = (
        np.array([f(row) for row in crossed]) for f in (lambda r: r["crossing"], lambda r: r["shares"]["local"])
    )
    gaps = np.abs(np.log(q / share)) - np.abs(np.log(q / 0.1))
    half = scipy.stats.t.ppf(0.975, len(gaps) - 1) * gaps.std(ddof=1) / np.sqrt(len(gaps)) if len(gaps) > 1 else None
    spoken = [row for row in found if row["agrees"] is not None]
    low, high = ([r for r in spoken if (r["shares"]["local"] >= 0.5) == is_high] for is_high in (False, True))
    told = {name: {"n_agree": sum(r["agrees"] for r in own), "n": len(own)} for name, own in (("1", low), ("2", high))}
    told["3"] = {"n": len(gaps), "mean_gap": float(gaps.mean()) if len(gaps) else None, "half_width": half}
    told["4"] = [
        {"by": a["by"], "start": a["start"], "cohort": a["cohort"], "subject": a["subject"],
         "shares": [a["shares"]["local"], b["shares"]["local"]], "crossings": [a["crossing"], b["crossing"]]}
        for a in found for b in found
        if (a["normal_scale"], b["normal_scale"]) == (1.0, 20.0)
        and all(a[k] == b[k] for k in ("by", "start", "cohort", "subject", "n_faces", "finest_mm"))
    ]  # fmt: skip
    return rounded({"trajectories": found, "predictions": told})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "new held-out subjects of the synthetic cohorts")
