"""The arms of the comparison: a loss, an encoding, and a number of support points, as a loss for ``fit_flow``."""

import numpy as np

from meshot import Mesh, quasi_directions, sliced_wasserstein
from meshot.flow import FitLoss
from meshot.loss import ENCODINGS, LOSSES, Encoding, MeasureLoss
from meshot.types import Tensor


def planned_arms(config: dict) -> list[dict]:
    """Every arm with all supports, except Sinkhorn; then every arm that has support points with few of them."""
    full = [arm | {"supports": "full"} for arm in config["arms"] if arm["loss"] != "sinkhorn"]
    return full + [arm | {"supports": config["few_supports"]} for arm in config["arms"] if arm["encoding"] != "surface"]


def arm_loss(arm: dict, target: Mesh, config: dict) -> FitLoss:
    """The loss between a deformed mesh and the target. Random numbers are drawn again in every call, on both sides."""
    encoding, of_measures = _encoding(arm, config), _loss(arm, config)
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


def _loss(arm: dict, config: dict) -> MeasureLoss | None:
    return None if arm["loss"] == "sliced" else LOSSES[arm["loss"]](**config.get(arm["loss"], {}))
