"""The cost of one step of a fit: memory of autograd in bytes, and seconds."""

import time

import numpy as np
from variants import compare, drawn_part, pair_of_meshes, reweighted

from meshot import Mesh, varifold
from meshot.flow import LearnedVelocity, grid_around, integrate
from meshot.measure import varifold_sample
from meshot_book.examples import peak_saved_bytes


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
