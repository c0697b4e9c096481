"""One flow of a sequence, fitted from the end of the flows before it."""

import json
import time
from pathlib import Path

import numpy as np
import torch
from surfaces import carried, cut_where_stretched
from tqdm import tqdm

from meshot.files import write_whole
from meshot.flow import Fit, FitLoss, FitSettings, Guard, fit_flow, grid_around, sliced_loss
from meshot.loss import chamfer
from meshot.measure import empirical, varifold
from meshot.mesh import Mesh, self_intersecting_faces
from meshot.metrics import Surface, average_surface_distance
from meshot.types import Tensor
from meshot_book.flows import Leg, without_crossings


def mended_chain(leg: dict, legs: list[Leg], start: Mesh) -> tuple[list[Leg], Mesh, dict]:
    """The legs and the start after repair, so that there are no self-intersections after any leg; and a record of it.

    ``leg`` has the settings of the last one. If it sets a longest edge, edges of the start that the sequence stretches
    are first divided. If it sets a radius, the flows are damped where faces still intersect, in earlier legs too,
    because the new faces have not been checked in them.
    """
    began = {"cpu": time.process_time(), "wall": time.perf_counter()}
    counts = {"fitted": crossings(legs, start)}
    if "longest_edge" in leg:
        start = cut_where_stretched(start, legs, leg["longest_edge"])
        counts["cut"] = crossings(legs, start)
    if "standstill" in leg:
        legs = stilled_chain(legs, start, leg["standstill"])
        counts["damped"] = crossings(legs, start)
    seconds = {"cpu": time.process_time() - began["cpu"], "wall": time.perf_counter() - began["wall"]}
    return legs, start, {"crossings": counts, "n_faces": len(start.faces), "seconds": seconds}


def stilled_chain(legs: list[Leg], start: Mesh, radius: float) -> list[Leg]:
    """All legs, damped where faces intersect after them."""
    done: list[Leg] = []
    for leg in legs:
        field = without_crossings(leg.field, carried(done, start), leg.n_steps, radius=radius)
        done.append(Leg(field, leg.n_steps))
    return done


def crossings(legs: list[Leg], start: Mesh) -> int:
    """The number of self-intersecting faces at the end of a sequence."""
    return len(self_intersecting_faces(carried(legs, start)))


#: The entries of a leg that are settings of the fit.
OF_THE_FIT = ("n_iterations", "learning_rate", "n_steps", "n_directions", "coarse_share")


class Clock:
    """CPU and wall-clock seconds of a fit. After an interruption they continue from the last saved state."""

    def __init__(self, path: Path):
        self.path = path
        self.spent = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"cpu": 0.0, "wall": 0.0}
        self.started = {"cpu": time.process_time(), "wall": time.perf_counter()}

    def now(self) -> dict[str, float]:
        """Seconds so far."""
        now = {"cpu": time.process_time(), "wall": time.perf_counter()}
        return {name: self.spent[name] + now[name] - self.started[name] for name in now}

    def save(self) -> None:
        """Store them, together with the state of the fit."""
        write_whole(self.path, json.dumps(self.now()))


def leg_settings(leg: dict, config: dict) -> FitSettings:
    """The settings of the fit of a leg, with the intervals of checks and saved states."""
    every = min(config["check_every"], max(1, leg["n_iterations"] // 4))
    numbers = {name: leg[name] for name in OF_THE_FIT if name in leg}
    if "n_directions" in numbers:
        numbers["n_directions"] = tuple(numbers["n_directions"])
    return FitSettings(**numbers, check_every=every, save_every=every, seed=config["seed"])


def guard_of(leg: dict) -> Guard:
    """A guard that allows no intersections at checks; None if the leg is repaired afterwards."""
    return Guard(max_crossings=10**9) if "standstill" in leg else Guard()


def leg_loss(leg: dict, target: Mesh, normal_scale: float) -> FitLoss:
    """Sliced Wasserstein on oriented varifolds, or Chamfer on points drawn from both surfaces in every call."""
    if leg["loss"] == "sliced":
        return sliced_loss(target, lambda mesh: varifold(mesh, normal_scale=normal_scale))

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        return chamfer(
            empirical(mesh, leg["n_points"], generator, detach_weights=True),
            empirical(target, leg["n_points"], generator, detach_weights=True),
        )

    return loss


def closeness(mesh: Mesh, target: Mesh, n_points: int, seed: int) -> float:
    """ASSD in mm, point to face, in both directions."""
    surfaces = Surface(mesh), Surface(target)
    samples = [
        surface.sample(n_points, np.random.default_rng(stream))
        for surface, stream in zip(surfaces, np.random.SeedSequence(seed).spawn(2), strict=True)
    ]
    return average_surface_distance(surfaces[1].offsets(samples[0]), surfaces[0].offsets(samples[1]))


def fit_leg(name: str, leg: dict, mesh: Mesh, target: Mesh, config: dict, partial: Path) -> tuple[Fit, dict]:
    """The flow that moves ``mesh`` on, fitted in single precision, and its time in seconds."""
    settings, mesh, goal = leg_settings(leg, config), mesh.to(torch.float32), target.to(torch.float32)
    field = grid_around(
        mesh.vertices, goal.vertices, margin=leg["margin"], spacings=tuple(leg["spacings"]), n_pieces=leg["n_pieces"]
    )
    clock = Clock(partial / f"{name}_seconds.json")

    def watch(moved: Mesh) -> dict[str, float]:
        distance = closeness(moved, target, config["n_watched_points"], config["seed"])
        return {"assd": distance, "cpu_seconds": clock.now()["cpu"]}

    with tqdm(total=settings.n_iterations, desc=name) as bar:

        def report(done: int, value: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{value:.4g}")
            if done % settings.save_every == 0 or done == settings.n_iterations:
                clock.save()

        checkpoint = partial / f"{name}.safetensors"
        loss = leg_loss(leg, goal, config["normal_scale"])
        fit = fit_flow(field, mesh, loss, settings, checkpoint, report, guard_of(leg), watch)
    return fit, json.loads(clock.path.read_text(encoding="utf-8"))
