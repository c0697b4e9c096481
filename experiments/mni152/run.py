"""White surfaces of the MNI152 T1, and a fitted flow from them to the surface of the white-matter map.

Every fit saves its state, so that a stopped run can be resumed with the same result.
"""

import itertools
import json
import os
import sys
import time
from pathlib import Path

import safetensors.torch
import torch
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES, fsaverage5_surface, mni152_brain_mask, mni152_t1, mni152_white_matter
from meshot.files import whole_file, write_whole
from meshot.flow import (
    FitSettings,
    GridVelocity,
    fit_flow,
    grid_around,
    integrate,
    read_velocity,
    sliced_loss,
    write_velocity,
)
from meshot.measure import varifold
from meshot.mesh import Mesh, decimated, face_areas, topology
from meshot.metrics import evaluate
from meshot.volume import dice, isosurface, white_matter_probability
from meshot_book.tissue import TissueSurface, hemisphere_region, restricted, tissue_surface

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

VELOCITY = "velocity_{}.safetensors.gz"
PARTS = ("surfaces", "flow", "before", "after")


def make_surfaces(side: str, config: dict, place: Path) -> dict:
    """Write initial surface and target of one hemisphere to ``place``. Returns counts of the intermediate results."""
    t1, white_matter = mni152_t1(), mni152_white_matter()
    guide = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    region = hemisphere_region(t1, *guide, side, **config["region"])
    sources = {"initial": white_matter_probability(t1, mni152_brain_mask()), "target": white_matter}
    made = {name: tissue_surface(restricted(source, region), config["n_faces"]) for name, source in sources.items()}
    for name, surface in made.items():
        tensors = {"vertices": surface.mesh.vertices, "faces": surface.mesh.faces}
        with whole_file(place / f"{side}_{name}.safetensors") as temporary:
            safetensors.torch.save_file(tensors, temporary)
    masks = [made[name].mask.data for name in ("initial", "target")]
    return {"dice_of_masks": dice(*masks)} | {name: count(surface) for name, surface in made.items()}


def count(surface: TissueSurface) -> dict:
    """Voxels, topology before and after the correction, faces, area."""
    n_before, n_after = (int(mask.data.sum()) for mask in (surface.mask, surface.genus_zero_mask))
    before = topology(isosurface(surface.mask.with_data(surface.mask.data.astype(float))))
    after = topology(surface.mesh)
    return {
        "n_voxels": n_before,
        "n_voxels_given_up": n_before - n_after,
        "euler_number_of_mask": before.euler_number,
        "nonmanifold_edges_of_mask": before.n_nonmanifold_edges,
        "euler_number": after.euler_number,
        "nonmanifold_edges": after.n_nonmanifold_edges,
        "n_faces": len(surface.mesh.faces),
        "area_mm2": float(face_areas(surface.mesh).sum()),
    }


def load(side: str, name: str, place: Path) -> Mesh:
    """A surface written by :func:`make_surfaces`."""
    return Mesh(**safetensors.torch.load_file(place / f"{side}_{name}.safetensors"))


def fit(side: str, field: GridVelocity, stage: int, config: dict, place: Path) -> tuple[GridVelocity, dict]:
    """One stage of the fit, resumed from its checkpoint. Returns the field and the history of the loss."""
    settings = dict(config["stages"][stage])
    n_faces = settings.pop("n_faces")
    initial, target = (decimated(load(side, name, place), n_faces).to(torch.float32) for name in ("initial", "target"))
    loss = sliced_loss(target, lambda mesh: varifold(mesh, normal_scale=config["normal_scale"]))
    settings = FitSettings(
        n_steps=config["n_steps"], seed=config["seed"] + stage, check_every=25, save_every=25,
        **settings | {"n_directions": tuple(settings["n_directions"])},
    )  # fmt: skip
    checkpoint = place / f"{side}_stage{stage}.safetensors"
    with tqdm(total=settings.n_iterations, desc=f"{side}, {n_faces} faces") as bar:
        clock = place / f"{side}_stage{stage}_seconds.json"
        spent = json.loads(clock.read_text(encoding="utf-8")) if clock.exists() else 0.0
        started = time.perf_counter()

        def report(done: int, value: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{value:.4g}")
            if done % settings.save_every == 0 or done == settings.n_iterations:
                write_whole(clock, json.dumps(spent + time.perf_counter() - started))

        fitted = fit_flow(field, initial, loss, settings, checkpoint, report)
    history = {k: fitted.history[k] for k in ("checked_iteration", "checked_loss")}
    seconds = json.loads(clock.read_text(encoding="utf-8"))
    return fitted.field, history | {"best_iteration": fitted.best_iteration, "seconds": seconds}


def fit_stages(side: str, config: dict, place: Path) -> dict:
    """Write the rounded flow of one side to ``place``. Returns the records of the fit and of the flow."""
    initial, target = (load(side, name, place) for name in ("initial", "target"))
    spacings = tuple(config["grid"]["spacings"])
    field = grid_around(
        initial.vertices.float(), target.vertices.float(), margin=config["grid"]["margin"], spacings=spacings,
        n_pieces=config["grid"]["n_pieces"],
    )  # fmt: skip
    stages = []
    for stage in range(len(config["stages"])):
        field, history = fit(side, field, stage, config, place)
        stages.append(history)
    write_velocity(place / VELOCITY.format(side), field, config["velocity_step"])
    rounded, moved = carried(side, config, place)
    return {
        "fit": stages,
        "lipschitz_per_step": float(rounded.lipschitz_bound()) / config["n_steps"],
        "largest_move_mm": float((moved.vertices - initial.vertices).norm(dim=1).max()),
        "area_after_mm2": float(face_areas(moved).sum()),
    }


def carried(side: str, config: dict, place: Path) -> tuple[GridVelocity, Mesh]:
    """The stored flow and the mesh moved by it, in double precision: the rounded field is measured."""
    field, initial = read_velocity(place / VELOCITY.format(side)).double(), load(side, "initial", place)
    with torch.no_grad():
        return field, initial.with_vertices(integrate(field, initial.vertices, config["n_steps"]))


def do_part(side: str, part: str, config: dict, place: Path) -> dict:
    """One part of a side. ``before`` and ``after`` are all metrics with their floors."""
    if part == "surfaces":
        return make_surfaces(side, config, place)
    if part == "flow":
        return fit_stages(side, config, place)
    mesh = load(side, "initial", place) if part == "before" else carried(side, config, place)[1]
    return evaluate(mesh, load(side, "target", place), config["n_points"], config["seed"]).as_dict()


def told(found: dict[str, dict], seconds: dict[str, float]) -> dict:
    """The results of one side."""
    return {
        "surfaces": found["surfaces"] | {"seconds": seconds["surfaces"]},
        **found["flow"],
        "metrics": {when: found[when] for when in ("before", "after")},
        "seconds_of_metrics": seconds["before"] + seconds["after"],
    }


def tasks(config: dict) -> list[tuple[str, str]]:
    """All parts of both hemispheres."""
    return list(itertools.product(HEMISPHERES, PARTS))


def work(task: tuple[str, str], config: experiment.Config) -> dict:
    """One part of a hemisphere."""
    # Otherwise torch adds gradients of shared vertices in the varying order of its threads.
    torch.use_deterministic_algorithms(True)
    return do_part(*task, config, config.place)


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The results of both hemispheres; their flows are moved beside the file of the results."""
    found, spent = ({tuple(row["task"]): row[key] for row in rows} for key in ("found", "seconds"))
    for name in map(VELOCITY.format, HEMISPHERES):
        os.replace(config.place / name, config.output.with_name(name))
    return {
        side: told(*({part: values[side, part] for part in PARTS} for values in (found, spent))) for side in HEMISPHERES
    }


if __name__ == "__main__":
    data = "MNI152 group average (ICBM 2009a, symmetric; not a person); guide: fsaverage5 (FreeSurfer)"
    experiment.run(__file__, tasks, work, results, data)
