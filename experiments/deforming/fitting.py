"""One fit: the mesh and the elapsed time at every check, and its evaluation."""

import dataclasses
import time

import numpy as np
import torch
from meshes import start_mesh, target_mesh

from meshot import Mesh, evaluate, quasi_directions, sliced_wasserstein
from meshot.flow import FitLoss, FitSettings, fit_flow, grid_around, trajectory
from meshot.loss import ENCODINGS, LOSSES, Encoding
from meshot.mesh import self_intersecting_faces
from meshot.metrics import (
    Surface,
    average_surface_distance,
    edge_length_variation,
    face_area_variation,
    normal_agreement,
    smallest_angles,
)
from meshot.types import Tensor
from meshot_book.statistics import short


def planned_arms(config: dict) -> list[dict]:
    """Every arm with all supports, except Sinkhorn; then every arm that has support points with few of them."""
    full = [arm | {"supports": "full"} for arm in config["arms"] if arm["loss"] != "sinkhorn"]
    return full + [arm | {"supports": config["few_supports"]} for arm in config["arms"] if arm["encoding"] != "surface"]


def arm_loss(arm: dict, target: Mesh, config: dict) -> FitLoss:
    """The loss between a deformed mesh and the target. Random numbers are drawn again in every call, on both sides."""
    encoding = _encoding(arm, config)
    of_measures = None if arm["loss"] == "sliced" else LOSSES[arm["loss"]](**config.get(arm["loss"], {}))
    drawn, n_faces = arm["encoding"] == "samples" or arm["supports"] != "full", len(target.faces)
    fixed = None if drawn else encoding.measure(target, n_faces, np.random.default_rng(0))

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        source = encoding.measure(mesh, n_faces, generator)
        goal = encoding.measure(target, n_faces, generator) if fixed is None else fixed
        if of_measures is not None:
            return of_measures(source, goal, generator)
        # The fit determines the number of directions, which are quasi-random.
        places = source.places
        directions = quasi_directions(n_directions, places.shape[1], int(generator.integers(2**31)))
        return sliced_wasserstein(source, goal, directions.to(places))

    return loss


def n_supports(arm: dict, target: Mesh) -> int:
    """The number of support points on either side. "full" means the number of faces, for samples and varifold alike."""
    return len(target.faces) if arm["supports"] == "full" else arm["supports"]


def _encoding(arm: dict, config: dict) -> Encoding:
    settings = {} if arm["supports"] == "full" or arm["encoding"] == "surface" else {"n_supports": arm["supports"]}
    if arm["encoding"] == "varifold":
        settings["normal_scale"] = config["normal_scale"]
        if "n_supports" in settings:
            settings["detach_weights"] = arm.get("detached", config["few_detached"][arm["loss"]])
    return ENCODINGS[arm["encoding"]](**settings)


CURVES = ("assd", "normals", "intersecting_faces", "edge_variation", "area_variation", "smallest_angle")


class Watch:
    """A loss that stores the mesh of every check, and measures the time of iterations without checks.

    The fit calls the loss with gradients in an iteration, and without gradients in a check.
    """

    def __init__(self, loss: FitLoss):
        self.loss = loss
        self.meshes: list[Mesh] = []
        self.checked_at: list[float] = []
        self.begun, self.in_checks, self.until = 0.0, 0.0, 0.0

    def start(self) -> None:
        """Start the clock."""
        self.begun = time.process_time()

    def __call__(self, mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        """The loss. In a check, the mesh is stored and the time does not count."""
        if torch.is_grad_enabled():
            return self.loss(mesh, n_directions, generator)
        entered = time.process_time()
        self.checked_at.append(entered - self.begun - self.in_checks)
        self.meshes.append(mesh)
        value = self.loss(mesh, n_directions, generator)
        self.in_checks += time.process_time() - entered
        return value


def fit_once(task: dict, config: dict) -> tuple[dict, dict[str, Mesh]]:
    """Fit one arm in one setting. Returns numbers, and the meshes at the end and along the flow."""
    goal = target_mesh(task["target"], task["seed"], config)
    begin = start_mesh(task["start"], task["target"], goal, config)
    moving, fixed = begin.to(torch.float32), goal.to(torch.float32)
    settings = fit_settings(task, config)
    grid = config["grid"] | {"spacings": tuple(config["targets"][task["target"]]["spacings"])}
    field = grid_around(moving.vertices, fixed.vertices, **grid)
    watch = Watch(arm_loss(task, fixed, config))
    fit_flow(field, moving, watch.loss, dataclasses.replace(settings, n_iterations=1))  # compiles all kernels
    watch.start()
    fitted = fit_flow(field, moving, watch, settings)
    ruler = Ruler(goal, config)
    rows = [ruler.curve(mesh) for mesh in [begin, *watch.meshes]]
    curve = {"iteration": [0, *fitted.history["checked_iteration"]], "seconds": [0.0, *watch.checked_at]}
    curve |= {name: [row[name] for row in rows] for name in CURVES}
    last = watch.meshes[-1]
    found = {
        "n_iterations": settings.n_iterations,
        "seconds": short(watch.checked_at[-1]),
        "lipschitz_per_step": short(float(fitted.field.lipschitz_bound()) / settings.n_steps),
        "end": ruler.all(last)[0],
        "curve": {name: [short(x) for x in entries] for name, entries in curve.items()},
    }
    return found, {"end": last} | _path(fitted.field, moving, settings.n_steps)


def fit_settings(task: dict, config: dict) -> FitSettings:
    """The settings of the fit, the same for every arm."""
    n_iterations = config["targets"][task["target"]]["n_iterations"]
    return FitSettings(
        n_iterations=n_iterations, check_every=n_iterations // config["n_checks"], learning_rate=task["learning_rate"],
        seed=task["seed"], **config["fit"] | {"n_directions": tuple(config["fit"]["n_directions"])},
    )  # fmt: skip


@torch.no_grad()
def _path(field: torch.nn.Module, mesh: Mesh, n_steps: int) -> dict[str, Mesh]:
    along = trajectory(field, mesh.vertices, n_steps)
    return {f"path/{k}": mesh.with_vertices(vertices) for k, vertices in enumerate(along)}


class Ruler:
    """The metrics to one target, always with points of the same seed."""

    def __init__(self, goal: Mesh, config: dict):
        self.goal, self.config = goal, config
        self.surface = Surface(goal)
        self.streams = np.random.SeedSequence(config["judge_seed"]).spawn(2)
        self.sample = self.surface.sample(config["n_points"], np.random.default_rng(self.streams[1]))

    def all(self, mesh: Mesh) -> tuple[dict[str, float], dict[str, float]]:
        """All metrics of the package, and their floors."""
        config = self.config
        counts = {"n_points": config["n_points"], "n_emd_points": config["n_emd_points"]}
        found = evaluate(mesh, self.goal, seed=config["judge_seed"], **counts).as_dict()
        values = {name: short(metric["value"]) for name, metric in found.items()}
        return values, {name: short(metric["floor"]) for name, metric in found.items()}

    def curve(self, mesh: Mesh) -> dict[str, float]:
        """The metrics of the curves, from the same points."""
        moved = Surface(mesh)
        drawn = moved.sample(self.config["n_points"], np.random.default_rng(self.streams[0]))
        there, back = self.surface.offsets(drawn), moved.offsets(self.sample)
        return {
            "assd": average_surface_distance(there, back),
            "normals": normal_agreement(there, back),
            "intersecting_faces": len(self_intersecting_faces(mesh)),
            "edge_variation": edge_length_variation(mesh),
            "area_variation": face_area_variation(mesh),
            "smallest_angle": float(smallest_angles(mesh).mean()),
        }
