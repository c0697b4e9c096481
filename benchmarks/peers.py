"""The compared losses: each as a call that computes value and gradient in the source, on given inputs."""

import dataclasses
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import data
import numpy as np
import ot
import torch

from meshot import DiscreteMeasure, chamfer, sliced_wasserstein
from meshot.loss import normal_inconsistency, plain_sliced_wasserstein, squared_edge_length, squared_laplacian
from meshot.workers import in_chunks

Call = Callable[[], object]
OURS, PLAIN, EXACT = "sliced, fused", "sliced, plain torch", "sliced, exact continuous"
VALUE = "sliced, exact continuous, value only"
POT, OTT_SLICED = "sliced, POT", "sliced, OTT"
DENSE, LAZY, MULTISCALE = "Sinkhorn, GeomLoss dense", "Sinkhorn, GeomLoss lazy", "Sinkhorn, GeomLoss multiscale"
OTT_DENSE, OTT_LAZY = "Sinkhorn, OTT dense", "Sinkhorn, OTT lazy"
BRUTE, TREE, REGULARISED = "Chamfer, brute force", "Chamfer, k-d tree", "Chamfer, k-d tree, regularised"
FLOOR = "np.argsort, both sides"

BLUR, SCALING = 1.0, 0.5  # in mm; factor per step by which the blur decreases from the diameter
OTT_STEPS = 10  # iterations of Sinkhorn's algorithm, about as many as GeomLoss takes from the diameter to the blur
OTT_BATCH = 1024  # rows of the cost matrix that the lazy variant stores at a time


@dataclasses.dataclass(frozen=True, eq=False)
class Peer:
    """How to prepare a loss for given inputs, and a lower bound of its memory in bytes.

    ``make(m, d, n_directions, seed)`` returns the call that is timed. If a loss ``compiles`` for every new size, its
    first call is not representative.
    """

    make: Callable[[int, int, int, int], Call]
    bytes_per_pair: float = 0.0
    bytes_per_support: float = 0.0
    compiles: bool = False


def prepare() -> dict[str, str]:
    """Make the additional libraries importable. Returns, for those that cannot run, the reason."""
    # The folder where "make benchmark" installs libraries that only benchmarks need.
    folder = str(Path(__file__).resolve().parent.parent / "build" / "peers")
    if folder not in sys.path:
        sys.path.append(folder)
    # KeOps asks another Python process for the headers of pybind11.
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [folder, os.environ.get("PYTHONPATH")]))
    os.environ.setdefault("KEOPS_VERBOSE", "0")
    missing = {}
    for name, peers in {"ott": (OTT_SLICED, OTT_DENSE, OTT_LAZY), "pykeops": (LAZY, MULTISCALE)}.items():
        try:
            __import__(name)
            # GeomLoss checks for KeOps on import, and meshot has already imported it.
            for module in [module for module in sys.modules if module.split(".")[0] == "geomloss"]:
                del sys.modules[module]
        except ImportError as error:
            missing |= dict.fromkeys(peers, f"{name} is not installed ({error}): run make benchmark")
    return missing


def _sliced(loss: Callable[..., torch.Tensor]) -> Callable[..., Call]:
    def make(m: int, d: int, n_directions: int, seed: int) -> Call:
        source, target = data.measures(m, d, seed)
        lines = data.directions(n_directions, d, seed)
        wanted = source.points, source.weights
        return lambda: torch.autograd.grad(loss(source, target, lines), wanted)

    return make


def _pot(source: DiscreteMeasure, target: DiscreteMeasure, lines: torch.Tensor) -> torch.Tensor:
    distance = ot.sliced.sliced_wasserstein_distance
    return distance(source.points, target.points, source.weights, target.weights, projections=lines.T) ** 2


def _regularised(m: int, d: int, n_directions: int, seed: int) -> Call:
    source, target = data.measures(m, d, seed)
    template = data.mesh_of(source)

    def loss() -> torch.Tensor:
        mesh = template.with_vertices(source.points[:, :3])
        penalties = squared_edge_length(mesh) + normal_inconsistency(mesh) + squared_laplacian(mesh)
        return chamfer(source, target) + 0.1 * penalties

    return lambda: torch.autograd.grad(loss(), (source.points, source.weights))


def _exact(m: int, d: int, n_directions: int, seed: int) -> Call:
    vertices, source, target = data.surfaces(m, d)
    lines = data.directions(n_directions, d, seed)
    return lambda: torch.autograd.grad(sliced_wasserstein(source, target, lines), vertices, retain_graph=True)


def _exact_value(m: int, d: int, n_directions: int, seed: int) -> Call:
    _, source, target = data.surfaces(m, d)
    lines = data.directions(n_directions, d, seed)

    def call() -> None:
        with torch.no_grad():
            sliced_wasserstein(source, target, lines)

    return call


def _geomloss(backend: str) -> Callable[..., Call]:
    def make(m: int, d: int, n_directions: int, seed: int) -> Call:
        import geomloss

        source, target = data.measures(m, d, seed)
        loss = geomloss.SamplesLoss("sinkhorn", p=2, blur=BLUR, scaling=SCALING, backend=backend)
        sides = source.weights, source.points, target.weights, target.points
        return lambda: torch.autograd.grad(loss(*sides), (source.points, source.weights))

    return make


def _ott(loss: Callable[..., object]) -> Callable[..., Call]:
    def make(m: int, d: int, n_directions: int, seed: int) -> Call:
        import jax

        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_enable_x64", True)
        source, target = data.measures(m, d, seed)
        tensors = source.points, source.weights, target.points, target.weights, data.directions(n_directions, d, seed)
        arrays = [jax.numpy.asarray(tensor.detach().numpy()) for tensor in tensors]
        compiled = jax.jit(jax.value_and_grad(loss, argnums=(0, 1)))
        return lambda: jax.block_until_ready(compiled(*arrays))

    return make


def _ott_sliced(x: object, a: object, y: object, b: object, lines: object) -> object:
    from ott.tools import sliced

    return sliced.sliced_wasserstein(x, y, a, b, proj_fn=lambda points: points @ lines.T)[0]


def _ott_sinkhorn(batch: int | None) -> Callable[..., object]:
    def loss(x: object, a: object, y: object, b: object, lines: object) -> object:
        from ott.geometry import epsilon_scheduler, pointcloud
        from ott.tools.sinkhorn_divergence import sinkhorn_divergence

        # GeomLoss halves the squared distance: its blur² is half of the epsilon used here.
        epsilon = epsilon_scheduler.Epsilon(target=2 * BLUR**2, init=100.0**2, decay=SCALING**2)
        steps = {"threshold": -1.0, "min_iterations": OTT_STEPS, "max_iterations": OTT_STEPS}
        steps |= {"inner_iterations": OTT_STEPS, "use_danskin": True}
        cloud = pointcloud.PointCloud
        return sinkhorn_divergence(cloud, x, y, a=a, b=b, epsilon=epsilon, batch_size=batch, solve_kwargs=steps)[0]

    return loss


def _floor(m: int, d: int, n_directions: int, seed: int) -> Call:
    """The time to sort values that are already projected. The call returns its own duration."""
    lines = data.directions(n_directions, d, seed).numpy()
    sides = [measure.points.detach().numpy() for measure in data.measures(m, d, seed)]

    def call() -> float:
        projected = [np.ascontiguousarray(lines @ side.T) for side in sides]
        started = time.perf_counter()
        in_chunks(lambda i, j: [np.argsort(side[i:j], axis=1) for side in projected], len(lines))
        return time.perf_counter() - started

    return call


PEERS = {
    OURS: Peer(_sliced(sliced_wasserstein)),
    PLAIN: Peer(_sliced(plain_sliced_wasserstein), bytes_per_support=100 * 200),
    EXACT: Peer(_exact),
    VALUE: Peer(_exact_value),
    POT: Peer(_sliced(_pot), bytes_per_support=100 * 200),
    OTT_SLICED: Peer(_ott(_ott_sliced), bytes_per_support=100 * 100, compiles=True),
    BRUTE: Peer(_sliced(lambda source, target, _: chamfer(source, target, "brute"))),
    TREE: Peer(_sliced(lambda source, target, _: chamfer(source, target))),
    REGULARISED: Peer(_regularised),
    DENSE: Peer(_geomloss("tensorized"), bytes_per_pair=100),
    LAZY: Peer(_geomloss("online"), compiles=True),
    MULTISCALE: Peer(_geomloss("multiscale"), compiles=True),
    OTT_DENSE: Peer(_ott(_ott_sinkhorn(None)), bytes_per_pair=50, compiles=True),
    OTT_LAZY: Peer(_ott(_ott_sinkhorn(OTT_BATCH)), compiles=True),
    FLOOR: Peer(_floor, bytes_per_support=100 * 32),
}
