"""From the MNI152 T1 to white surfaces, and a fitted flow from there to the surface of the white-matter map.

Run as ``python experiments/mni152/run.py``. Every finished part is kept in ``partial/``, and every fit saves as it
goes, so that a run that was stopped goes on where it was and ends with the same result.
"""

import json
import shutil
import time
from pathlib import Path

import safetensors.torch
import torch
import yaml
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES, fsaverage5_surface, mni152_brain_mask, mni152_t1, mni152_white_matter
from meshot.files import whole_file
from meshot.flow import integrate
from meshot.flow.fields import GridVelocity, grid_around, quantised_velocity, write_velocity
from meshot.flow.fitting import FitSettings, fit_flow, sliced_loss
from meshot.measure import varifold
from meshot.mesh import Mesh
from meshot.mesh.editing import decimated
from meshot.mesh.geometry import face_areas
from meshot.mesh.topology import topology
from meshot.metrics import evaluate
from meshot.pipeline import TissueSurface, hemisphere_region, restricted, tissue_surface
from meshot.provenance import write_results
from meshot.volume import dice, white_matter_probability
from meshot.volume.surfaces import isosurface

HERE = Path(__file__).parent
PARTIAL = HERE / "partial"


def kept(name: str, make):
    """What ``make`` returns (JSON), from the file where an earlier run left it, with the seconds it took."""
    path = PARTIAL / f"{name}.json"
    if not path.exists():
        started = time.perf_counter()
        record = {"value": make(), "seconds": time.perf_counter() - started}
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(record), encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def make_surfaces(side: str, config: dict) -> dict:
    """Initial surface and target of one hemisphere, into ``partial/``; what was counted on the way."""
    t1, white_matter = mni152_t1(), mni152_white_matter()
    guide = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    region = hemisphere_region(t1, *guide, side, **config["region"])
    sources = {"initial": white_matter_probability(t1, mni152_brain_mask()), "target": white_matter}
    made = {name: tissue_surface(restricted(source, region), config["n_faces"]) for name, source in sources.items()}
    for name, surface in made.items():
        tensors = {"vertices": surface.mesh.vertices, "faces": surface.mesh.faces}
        with whole_file(PARTIAL / f"{side}_{name}.safetensors") as temporary:
            safetensors.torch.save_file(tensors, temporary)
    masks = [made[name].mask.data for name in ("initial", "target")]
    return {"dice_of_masks": dice(*masks)} | {name: count(surface) for name, surface in made.items()}


def count(surface: TissueSurface) -> dict:
    """Voxels, topology before and after, faces, area."""
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


def load(side: str, name: str) -> Mesh:
    """A surface that :func:`make_surfaces` left."""
    return Mesh(**safetensors.torch.load_file(PARTIAL / f"{side}_{name}.safetensors"))


def fit(side: str, field: GridVelocity, stage: int, config: dict) -> tuple[GridVelocity, dict]:
    """One stage of the fit, gone on with from its checkpoint; the field and how the loss fell."""
    settings = dict(config["stages"][stage])
    n_faces = settings.pop("n_faces")
    initial, target = (decimated(load(side, name), n_faces).to(torch.float32) for name in ("initial", "target"))
    loss = sliced_loss(target, lambda mesh: varifold(mesh, normal_scale=config["normal_scale"]))
    settings = FitSettings(
        n_steps=config["n_steps"], seed=config["seed"] + stage, check_every=25, save_every=25,
        **settings | {"n_directions": tuple(settings["n_directions"])},
    )  # fmt: skip
    checkpoint = PARTIAL / f"{side}_stage{stage}.safetensors"
    with tqdm(total=settings.n_iterations, desc=f"{side}, {n_faces} faces") as bar:
        clock = PARTIAL / f"{side}_stage{stage}_seconds.json"
        spent = json.loads(clock.read_text(encoding="utf-8")) if clock.exists() else 0.0
        started = time.perf_counter()

        def report(done: int, value: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{value:.4g}")
            if done % settings.save_every == 0 or done == settings.n_iterations:
                with whole_file(clock) as temporary:
                    temporary.write_text(json.dumps(spent + time.perf_counter() - started), encoding="utf-8")

        fitted = fit_flow(field, initial, loss, settings, checkpoint, report)
    history = {k: fitted.history[k] for k in ("checked_iteration", "checked_loss")}
    seconds = json.loads(clock.read_text(encoding="utf-8"))
    return fitted.field, history | {"best_iteration": fitted.best_iteration, "seconds": seconds}


def hemisphere(side: str, config: dict) -> dict:
    """Everything for one side; its velocity is written beside this file."""
    surfaces = kept(f"{side}_surfaces", lambda: make_surfaces(side, config))
    initial, target = load(side, "initial"), load(side, "target")
    spacings = tuple(config["grid"]["spacings"])
    field = grid_around(
        initial.vertices.float(), target.vertices.float(), margin=config["grid"]["margin"], spacings=spacings,
        n_pieces=config["grid"]["n_pieces"],
    )  # fmt: skip
    stages = []
    for stage in range(len(config["stages"])):
        field, history = fit(side, field, stage, config)
        stages.append(history)
    # What is measured is what is kept: the rounded field, applied in double precision.
    write_velocity(HERE / f"velocity_{side}.safetensors.gz", field, config["velocity_step"])
    rounded = quantised_velocity(field, config["velocity_step"]).double()
    with torch.no_grad():
        carried = initial.with_vertices(integrate(rounded, initial.vertices, config["n_steps"]))
    scores = {
        when: kept(f"{side}_{when}", lambda mesh=mesh: score(mesh, target, config))
        for when, mesh in (("before", initial), ("after", carried))
    }
    return {
        "surfaces": surfaces["value"] | {"seconds": surfaces["seconds"]},
        "fit": stages,
        "lipschitz_per_step": float(rounded.lipschitz_bound()) / config["n_steps"],
        "largest_move_mm": float((carried.vertices - initial.vertices).norm(dim=1).max()),
        "area_after_mm2": float(face_areas(carried).sum()),
        "metrics": {when: record["value"] for when, record in scores.items()},
        "seconds_of_metrics": sum(record["seconds"] for record in scores.values()),
    }


def score(mesh: Mesh, target: Mesh, config: dict) -> dict:
    """All metrics with their floors."""
    return evaluate(mesh, target, config["n_points"], config["seed"]).as_dict()


def main() -> None:
    """Both hemispheres, then the results."""
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    torch.set_num_threads(config["n_threads"])
    # Without this, torch adds gradients of shared corners in whatever order its threads arrive.
    torch.use_deterministic_algorithms(True)
    PARTIAL.mkdir(exist_ok=True)
    results = {side: hemisphere(side, config) for side in HEMISPHERES}
    seconds = sum(
        part["surfaces"]["seconds"] + part["seconds_of_metrics"] + sum(stage["seconds"] for stage in part["fit"])
        for part in results.values()
    )
    data = "MNI152 group average (ICBM 2009a, symmetric; not a person); guide: fsaverage5 (FreeSurfer)"
    write_results(HERE / "results.json", results, config, "python experiments/mni152/run.py", data, seconds)
    shutil.rmtree(PARTIAL)


if __name__ == "__main__":
    main()
