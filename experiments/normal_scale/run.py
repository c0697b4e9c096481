"""The share of the normals in the sliced loss of oriented varifolds, over their scale in mm."""

import itertools
import sys
from pathlib import Path

import numpy as np
import scipy.spatial
import torch

from meshot import DiscreteMeasure, Mesh, quasi_directions, sliced_wasserstein, varifold
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import folded_sphere, laplacian_smoothing
from meshot.types import Tensor
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def pairs(config: dict) -> dict[str, tuple[Mesh, Mesh]]:
    """Pairs of surfaces, in mm: near and far, smooth and rough, and one inside out."""
    white, pial = (fsaverage5_surface(kind, config["hemisphere"]) for kind in ("white", "pial"))
    folds = config["folds"]
    deep, shallow = (folded_sphere(folds["subdivisions"], folds["radius"], depth) for depth in folds["depths"])
    rough = torch.from_numpy(np.random.default_rng(0).standard_normal(white.vertices.shape))
    return {
        "white and pial": (white, pial),
        "white and smoothed": (white, laplacian_smoothing(white, config["smoothing_steps"])),
        "white and roughened": (white, white.with_vertices(white.vertices + config["noise"] * rough)),
        "white and shifted": (white, white.with_vertices(white.vertices + config["shift"] * torch.eye(3).double()[0])),
        "folds, deep and shallow": (deep, shallow),
        "white and inside out": (white, Mesh(white.vertices, white.faces.flip(1))),
    }


def half_extent(mesh: Mesh) -> float:
    """Half of the largest side of the bounding box of a mesh: the length of 1 in coordinates scaled to [-1, 1]."""
    return float((mesh.vertices.amax(dim=0) - mesh.vertices.amin(dim=0)).max()) / 2


def scales_of(config: dict, mesh: Mesh) -> list[float]:
    """A logarithmic grid of scales, 1 mm, and half the extent of the mesh."""
    grid = config["scales"]
    spaced = np.geomspace(grid["from"], grid["to"], grid["n"])
    return sorted({*(short(s) for s in spaced), 1.0, short(half_extent(mesh))})


def measure_pair(source: Mesh, target: Mesh, config: dict) -> dict:
    """SW₂² with and without normals in the same space R⁶, its gradient, and wrong neighbours, for every scale."""
    rows = [measure_scale(source, target, scale, config) for scale in scales_of(config, source)]
    return {"half_extent": half_extent(source), "rows": rows}


def _in_six(mesh: Mesh, scale: float) -> DiscreteMeasure:
    """The varifold in R⁶. At scale 0 its normals are zero."""
    measure = varifold(mesh, normal_scale=scale)
    points = torch.nn.functional.pad(measure.points, (0, 6 - measure.points.shape[1]))
    return DiscreteMeasure(points, measure.weights)


def measure_scale(source: Mesh, target: Mesh, scale: float, config: dict) -> dict:
    """All measurements at one scale: means over sets of directions, and the standard deviation of the share over them.

    The share is 1 − SW₂²(scale 0)/SW₂²(scale), both along the same directions of R⁶. The share in the gradient is
    computed from the norms of its two parts at the vertices: through normals and through positions, with fixed weights.
    """
    values, shares, pulls = [], [], []
    for seed in config["seeds"]:
        directions = quasi_directions(config["n_directions"], 6, seed)
        value, bare = (
            float(sliced_wasserstein(_in_six(source, s), _in_six(target, s), directions)) for s in (scale, 0.0)
        )
        values.append(value)
        shares.append(1 - bare / value)
        pulls.append(_gradient_share(source, target, scale, directions))
    return {
        "scale": scale,
        "value": float(np.mean(values)),
        "share": float(np.mean(shares)),
        "share_sd": float(np.std(shares, ddof=1)),
        "gradient_share": float(np.mean(pulls)),
        "wrong_neighbours": _wrong_neighbours(source, target, scale),
    }


def _gradient_share(source: Mesh, target: Mesh, scale: float, directions: Tensor) -> float:
    vertices = source.vertices.clone().requires_grad_()
    measure = varifold(source.with_vertices(vertices), normal_scale=scale, detach_weights=True)
    loss = sliced_wasserstein(measure, varifold(target, normal_scale=scale), directions)
    (pull,) = torch.autograd.grad(loss, measure.points, retain_graph=True)
    parts = []
    for columns in (slice(0, 3), slice(3, 6)):
        part = torch.zeros_like(pull)
        part[:, columns] = pull[:, columns]
        (at_vertices,) = torch.autograd.grad(measure.points, vertices, part, retain_graph=True)
        parts.append(float(at_vertices.norm()))
    return parts[1] / sum(parts)


def _wrong_neighbours(source: Mesh, target: Mesh, scale: float) -> float:
    """The fraction of the source's area whose nearest support point of the target has an opposite normal."""
    here, there = varifold(source, normal_scale=scale), varifold(target, normal_scale=scale)
    _, nearest = scipy.spatial.cKDTree(there.points.numpy()).query(here.points.numpy())
    normals, others = (varifold(mesh, normal_scale=1.0).points[:, 3:] for mesh in (source, target))
    facing = (normals * others[nearest]).sum(dim=1)
    return float(here.weights[facing < 0].sum())


def crossing_scale(rows: list[dict], share: float = 0.5) -> float | None:
    """The scale at which the share of the normals first reaches ``share``, interpolated on a logarithmic axis."""
    for low, high in itertools.pairwise(rows):
        if low["share"] < share <= high["share"]:
            part = (share - low["share"]) / (high["share"] - low["share"])
            return float(low["scale"] * (high["scale"] / low["scale"]) ** part)
    return None


def summarise(rows: list[dict], config: dict) -> dict:
    """What was measured for each pair, and the scale at which the normals are half of the loss."""
    found = ((row["task"], row["found"]) for row in rows)
    return {"pairs": [{"pair": pair, "half_of_loss_at": crossing_scale(of["rows"]), **of} for pair, of in found]}


def work(pair: str, config: dict) -> dict:
    """Everything about one pair of surfaces."""
    return measure_pair(*pairs(config)[pair], config)


if __name__ == "__main__":
    data = "the white and pial surfaces of fsaverage5; synthetic folded surfaces"
    experiment.run(__file__, lambda config: list(pairs(config)), work, summarise, data)
