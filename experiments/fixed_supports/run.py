"""Fits with a fixed number of support points: time and memory as the mesh grows, and the results of fits.

``results.json`` has, under "results":

- ``costs``: ``loss`` ("sliced", "chamfer"), ``variant`` ("all": the whole varifold; "drawn": a fixed number of faces
  drawn from the mesh after the flow, with gradients that stop at their areas; "through": with gradients that do not;
  "carried": drawn before the flow, which moves only their corners), ``n_faces``, ``step_bytes`` and ``step_seconds``
  of a step of a fit (flow, loss, gradient), ``loss_bytes`` and ``loss_seconds`` of the loss and its gradient alone.
  Bytes are the maximum held by autograd at a time, seconds are CPU seconds of one thread;
- ``fits``: from a sphere to an analytic surface under the sliced loss: ``variant``, ``n_supports``, ``n_seeds``, and
  mean, sd and values per seed of ``assd`` (mm), ``edge_variation`` and ``intersecting_faces``;
- ``differences``: paired over seeds, a fixed number minus all: ``assd_gap``, ``assd_low``, ``assd_high`` (95 %).
"""

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, chamfer, evaluate, quasi_directions, sliced_wasserstein, varifold
from meshot.flow import FitSettings, LearnedVelocity, fit_flow, grid_around, integrate
from meshot.measure import varifold_sample
from meshot.mesh import face_areas, folded_sphere, icosphere, sample_locations, signed_volume
from meshot.provenance import rounded
from meshot.types import Tensor
from meshot_book.examples import peak_saved_bytes
from meshot_book.statistics import arm_differences, short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def cost_rows(config: dict) -> list[dict]:
    """Every loss and variant on every mesh: the whole step, and the loss alone on an existing mesh."""
    costs, rows = config["cost"], []
    for subdivisions in costs["subdivisions"]:
        start, target = pair_of_meshes(subdivisions, 0, config)
        field = grid_around(start.vertices, target.vertices, **config["grid"] | {"spacings": _spacings(config)})
        for loss in costs["losses"]:
            for variant in costs["variants"]:
                row = {"loss": loss, "variant": variant, "n_faces": len(start.faces)}
                rows.append(row | _measured(loss, variant, field, start, target, config))
    return rows


def _spacings(config: dict) -> tuple[float, ...]:
    return tuple(config["grid"]["spacings"])


def _measured(
    loss: str, variant: str, field: LearnedVelocity, start: Mesh, target: Mesh, config: dict
) -> dict[str, float]:
    found = {}
    for part, moved in (("step", field), ("loss", None)):

        def run(moved: LearnedVelocity | None = moved) -> None:
            one_step(loss, variant, moved, start, target, config)

        run()
        seconds = []
        for _ in range(config["cost"]["n_rounds"]):
            began = time.process_time()
            run()
            seconds.append(time.process_time() - began)
        found |= {f"{part}_bytes": peak_saved_bytes(run), f"{part}_seconds": float(f"{np.median(seconds):.4g}")}
    return found


def one_step(loss: str, variant: str, field: LearnedVelocity | None, start: Mesh, target: Mesh, config: dict) -> None:
    """Value and gradient, with respect to the field, or to the vertices if there is no field."""
    n_supports, scale = config["cost"]["n_supports"], config["normal_scale"]
    generator = np.random.default_rng(0)
    before = drawn_part(start, n_supports, generator) if variant == "carried" else start
    vertices = before.vertices if field is not None else before.vertices.clone().requires_grad_()
    mesh = before.with_vertices(vertices if field is None else integrate(field, vertices, config["n_steps"]))
    if variant == "all":
        source, goal = varifold(mesh, normal_scale=scale), varifold(target, normal_scale=scale)
    else:
        goal = varifold_sample(target, n_supports, generator, normal_scale=scale)
        if variant == "carried":
            source = reweighted(mesh, before, scale)
        else:
            source = varifold_sample(mesh, n_supports, generator, normal_scale=scale, detach_weights=variant == "drawn")
    compare(loss, source, goal, config["cost"]["n_directions"], 0).backward()
    for parameter in field.parameters() if field is not None else ():
        parameter.grad = None


def pair_of_meshes(subdivisions: int, seed: int, config: dict) -> tuple[Mesh, Mesh]:
    """A sphere, and the analytic target, stretched and rotated by the seed, with as many faces."""
    shape = dict(config["shape"])
    generator = np.random.default_rng([seed, 0])
    stretch = 1 + shape.pop("stretch") * generator.uniform(-1, 1, 3)
    turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    folded = folded_sphere(subdivisions, **shape)
    target = folded.with_vertices(folded.vertices @ torch.from_numpy(np.diag(stretch) @ turn.T))
    radius = (3 * float(signed_volume(target)) / (4 * math.pi)) ** (1 / 3)
    return icosphere(subdivisions, radius, dtype=torch.float32), target.to(torch.float32)


def drawn_part(mesh: Mesh, n_faces: int, generator: np.random.Generator) -> Mesh:
    """Faces drawn by area, with their corners and no other vertices."""
    drawn, _ = sample_locations(mesh, n_faces, generator)
    named, corners = mesh.faces[drawn].unique(return_inverse=True)
    return Mesh(mesh.vertices[named], corners)


def reweighted(part: Mesh, before: Mesh, normal_scale: float) -> DiscreteMeasure:
    """Drawn faces after the flow. They were drawn by area before it, so each mass is the growth of its face."""
    growth = face_areas(part) / face_areas(before)
    return DiscreteMeasure(varifold(part, normal_scale=normal_scale).points, growth / growth.sum())


def compare(loss: str, source: DiscreteMeasure, target: DiscreteMeasure, n_directions: int, seed: int) -> Tensor:
    """One of the two losses between measures."""
    if loss == "chamfer":
        return chamfer(source, target)
    directions = quasi_directions(n_directions, source.points.shape[1], seed).to(source.points)
    return sliced_wasserstein(source, target, directions)


def fit_loss(variant: str, n_supports: int, start: Mesh, target: Mesh, normal_scale: float) -> Callable:
    """A loss of the moved mesh, for a fit.

    Variants: "all" faces; faces "drawn" from the moved mesh, with gradients that stop at their areas, or go "through"
    them; or "carried", with faces drawn from the start. In the last case the fit moves all vertices, but only corners
    of drawn faces have a gradient. The result is the same as if only these corners were moved.
    """
    whole = varifold(target, normal_scale=normal_scale)

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        seed = int(generator.integers(2**31))
        if variant == "all":
            return compare("sliced", varifold(mesh, normal_scale=normal_scale), whole, n_directions, seed)
        goal = varifold_sample(target, n_supports, generator, normal_scale=normal_scale)
        if variant != "carried":
            source = varifold_sample(
                mesh, n_supports, generator, normal_scale=normal_scale, detach_weights=variant == "drawn"
            )
            return compare("sliced", source, goal, n_directions, seed)
        drawn, _ = sample_locations(start, n_supports, generator)
        part, before = (Mesh(m.vertices, m.faces[drawn]) for m in (mesh, start))
        return compare("sliced", reweighted(part, before, normal_scale), goal, n_directions, seed)

    return loss


MEASURED = ("assd", "edge_variation", "intersecting_faces")


def planned_fits(config: dict) -> list[dict]:
    """All support points, and every fixed number, for every seed."""
    fits = config["fits"]
    n_faces = 20 * 4 ** fits["subdivisions"]
    kinds = [("all", n_faces)] + [(variant, n) for variant, counts in fits["n_supports"].items() for n in counts]
    return [{"variant": v, "n_supports": n, "seed": seed} for v, n in kinds for seed in fits["seeds"]]


def fit_once(task: dict, config: dict) -> dict[str, float]:
    """One fit, with closeness and regularity of its mesh."""
    fits = config["fits"]
    start, target = pair_of_meshes(fits["subdivisions"], task["seed"], config)
    spacings = tuple(config["grid"]["spacings"])
    field = grid_around(start.vertices, target.vertices, **config["grid"] | {"spacings": spacings})
    settings = FitSettings(
        n_iterations=fits["n_iterations"], learning_rate=fits["learning_rate"], n_steps=config["n_steps"],
        n_directions=tuple(fits["n_directions"]), seed=task["seed"],
    )  # fmt: skip
    loss = fit_loss(task["variant"], task["n_supports"], start, target, config["normal_scale"])
    values = evaluate(fit_flow(field, start, loss, settings).mesh, target, config["n_points"], n_emd_points=100)
    return {name: short(getattr(values, name).value) for name in MEASURED}


def summarise(rows: list[dict]) -> list[dict]:
    """Statistics of every variant and number of support points over the seeds."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        groups.setdefault((row["task"]["variant"], row["task"]["n_supports"]), []).append(row["found"])
    summary = []
    for (variant, n_supports), group in groups.items():
        row = {"variant": variant, "n_supports": n_supports, "n_seeds": len(group)}
        for name in MEASURED:
            values = np.array([found[name] for found in group])
            row |= {f"{name}_mean": short(values.mean()), f"{name}_sd": short(values.std(ddof=1))}
            row[f"{name}_seeds"] = values.tolist()
        summary.append(row)
    return summary


def differences(summary: list[dict]) -> list[dict]:
    """A fixed number minus all, paired over seeds, with the 95 % interval (Student's t)."""
    whole = next(row for row in summary if row["variant"] == "all")
    rows = []
    for row in (row for row in summary if row["variant"] != "all"):
        kind = {"variant": row["variant"], "n_supports": row["n_supports"], "n_seeds": row["n_seeds"]}
        rows.append(kind | rounded(arm_differences({"assd": row["assd_seeds"]}, {"assd": whole["assd_seeds"]})))
    return rows


def results(rows: list[dict], config: dict) -> dict:
    """The costs of a step, the fits, and their differences."""
    summary = summarise(rows)
    return {"costs": cost_rows(config), "fits": summary, "differences": differences(summary)}


if __name__ == "__main__":
    experiment.run(__file__, planned_fits, fit_once, results, "analytic folded surfaces")
