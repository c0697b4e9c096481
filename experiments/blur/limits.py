"""Limits of the Sinkhorn divergence: exact transport for small blur, the energy distance for large blur."""

import numpy as np
import ot
import torch
from fitting import make_pair

from meshot import DiscreteMeasure, Mesh, sinkhorn_divergence, varifold, wasserstein
from meshot.types import Array, Tensor


def limit_rows(config: dict) -> list[dict]:
    """Value and gradient over the blur, for both exponents and several scalings, at one start and target."""
    start, target = make_pair(config["seeds"][0], config)
    scale = config["normal_scale_mm"]
    measures = varifold(start, normal_scale=scale), varifold(target, normal_scale=scale)
    rows = []
    for p in config["limits"]["exponents"]:
        exact, energy = exact_cost(*measures, p), energy_distance(*measures, p)
        transport_gradient = vertex_gradient(start, lambda m, p=p: wasserstein(m, measures[1], p), scale)
        for scaling in config["limits"]["scalings"]:
            for blur in config["limits"]["blurs_mm"]:
                settings = {"p": p, "blur": blur, "scaling": scaling}
                value = float(sinkhorn_divergence(*measures, **settings))
                gradient = vertex_gradient(start, lambda m, s=settings: sinkhorn_divergence(m, measures[1], **s), scale)
                rows.append(
                    settings
                    | {"value": value, "exact": exact, "energy": energy}
                    | {"off_exact": value / exact - 1, "off_energy": value / energy - 1}
                    | {"cosine_to_exact": _cosine(gradient, transport_gradient), "uniformity": _uniformity(gradient)}
                )
    return rows


def exact_cost(source: DiscreteMeasure, target: DiscreteMeasure, p: int) -> float:
    """W_p^p by POT."""
    cost = ot.dist(source.points.numpy(), target.points.numpy(), metric="euclidean") ** p
    return float(ot.emd2(source.weights.numpy(), target.weights.numpy(), cost, numItermax=10_000_000))


def energy_distance(source: DiscreteMeasure, target: DiscreteMeasure, p: int) -> float:
    """E|X − Y|^p − ½ E|X − X'|^p − ½ E|Y − Y'|^p. For p = 2 this is the squared distance between the two means."""

    def mean_cost(a: DiscreteMeasure, b: DiscreteMeasure) -> float:
        cost = ot.dist(a.points.numpy(), b.points.numpy(), metric="euclidean") ** p
        return float(a.weights.numpy() @ cost @ b.weights.numpy())

    return mean_cost(source, target) - (mean_cost(source, source) + mean_cost(target, target)) / 2


def vertex_gradient(mesh: Mesh, loss: object, normal_scale: float) -> Array:
    """The gradient of a loss between varifolds in barycentres and normals of the moving side, per unit of mass."""
    measure = varifold(mesh, normal_scale=normal_scale)
    points = measure.points.detach().clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(DiscreteMeasure(points, measure.weights)), points)
    return _per_mass(gradient, measure.weights)


def _per_mass(gradient: Tensor, weights: Tensor) -> Array:
    return (gradient / weights[:, None]).numpy()


def _cosine(a: Array, b: Array) -> float:
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


def _uniformity(gradient: Array) -> float:
    """|mean gradient|² / mean |gradient|²: one if the gradient is the same at every face, that is, a translation."""
    return float(np.square(gradient.mean(axis=0)).sum() / np.square(gradient).sum(axis=1).mean())
