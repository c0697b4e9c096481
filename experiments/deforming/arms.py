"""The arms: a loss, what it compares, and with how many supports; each a loss of the carried mesh for the fit."""

from collections.abc import Callable

import numpy as np

from meshot import (
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    chamfer,
    empirical,
    quasi_directions,
    sinkhorn_divergence,
    sliced_wasserstein,
    surface,
    varifold,
)
from meshot.flow.fitting import FitLoss
from meshot.measure import varifold_sample
from meshot.types import Tensor

Measure = DiscreteMeasure | SurfaceMeasure


def planned_arms(config: dict) -> list[dict]:
    """Every arm with all supports, but for Sinkhorn; then every one that has supports with few of them."""
    full = [arm | {"supports": "full"} for arm in config["arms"] if arm["loss"] != "sinkhorn"]
    return full + [arm | {"supports": config["few_supports"]} for arm in config["arms"] if arm["encoding"] != "surface"]


def arm_loss(arm: dict, target: Mesh, config: dict) -> FitLoss:
    """The loss of a carried mesh to the target; whatever is drawn is drawn anew at every call, on both sides."""
    encode = _encoder(arm, len(target.faces), config)
    drawn = arm["encoding"] == "samples" or arm["supports"] != "full"
    fixed = None if drawn else encode(target, np.random.default_rng(0))

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        source = encode(mesh, generator)
        goal = encode(target, generator) if fixed is None else fixed
        if arm["loss"] == "chamfer":
            return chamfer(source, goal)
        if arm["loss"] == "sinkhorn":
            return sinkhorn_divergence(source, goal, **config["sinkhorn"])
        places = source.places
        directions = quasi_directions(n_directions, places.shape[1], int(generator.integers(2**31)))
        return sliced_wasserstein(source, goal, directions.to(places))

    return loss


def n_supports(arm: dict, target: Mesh) -> int:
    """How many supports either side has: as many as faces if all, so that samples and varifold have the same."""
    return len(target.faces) if arm["supports"] == "full" else arm["supports"]


def _encoder(arm: dict, n_faces: int, config: dict) -> Callable[[Mesh, np.random.Generator], Measure]:
    whole, scale = arm["supports"] == "full", config["normal_scale"]
    detached = arm.get("detached", config["few_detached"][arm["loss"]])
    if arm["encoding"] == "surface":
        return lambda mesh, generator: surface(mesh)
    if arm["encoding"] == "samples":
        return lambda mesh, generator: empirical(
            mesh, n_faces if whole else arm["supports"], generator, detach_weights=True
        )
    if whole:
        return lambda mesh, generator: varifold(mesh, normal_scale=scale)
    return lambda mesh, generator: varifold_sample(
        mesh, arm["supports"], generator, normal_scale=scale, detach_weights=detached
    )
