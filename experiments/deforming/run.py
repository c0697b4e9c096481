"""Deform meshes with one velocity field and one optimiser under seven losses: closeness, mesh regularity, time.

An *arm* is ``loss`` ("sliced", "chamfer", "sinkhorn"), ``encoding`` ("varifold", "samples", "surface": the exact
continuous measure, for "sliced" only) and ``supports`` ("full": as many as faces, or the whole varifold; or a number of
faces or points drawn at every step, on both sides). A *setting* is ``target`` ("folded": analytic, another member of
the family for each seed; "fsaverage5_left", "fsaverage5_right"), ``start`` ("sphere", "smoothed"), ``seed``.

``results.json`` has, under "results" (all lengths in mm, ``seconds`` are CPU seconds of one thread without checks):

- ``rates``: loss, encoding, supports, ``learning_rate``, ``assd``, ``edge_variation``: results with other learning
  rates than the common one, for a separate seed, from the sphere to "folded";
- ``areas``: the same with ``detached``: whether gradients stop at the areas of the drawn faces;
- ``settings``: target, start, seed, ``n_vertices``, ``n_faces``, ``floor`` {metric: value of the target against
  itself}, ``begin`` {metric: value of the start};
- ``fits``: arm and setting; ``n_supports``, ``learning_rate``, ``n_iterations``, ``seconds``, ``lipschitz_per_step``
  (bound of h·Lip), ``end`` {metric: value after the last step}, ``curve`` {``iteration``, ``seconds`` and METRICS:
  lists over the start and the twelve checks};
- ``summary``: target, start, arm, ``n_seeds``, ``at`` ("steps": after the last step of every arm; "seconds": when the
  first arm of the same setting and supports was finished, linear between checks), and for each metric of the curves,
  and for ``seconds`` and ``iteration``, ``NAME_mean``, ``NAME_sd`` (null for one seed); at "steps" also for all of
  ``end``;
- ``differences``: target, start, encoding, supports, ``at`` ("steps", "seconds", "closeness": where both have the ASSD
  of the one that ends farther away), paired over seeds: Chamfer minus sliced, ``NAME_chamfer``, ``NAME_sliced``,
  ``NAME_gap``, ``NAME_low``, ``NAME_high`` (95 %, Student's t), ``n_seeds``;
- ``missing``: the settings and arms that were planned but are not finished.

The metrics of ``end``, ``floor`` and ``begin``: those of :func:`meshot.metrics.evaluate` (emd, swd, assd,
hausdorff, normals, signed_normals, intersecting_faces, intersecting_share, euler_number, area, volume, edge_variation,
area_variation, smallest_angle). METRICS of the curves: assd, normals, intersecting_faces, edge_variation,
area_variation, smallest_angle.

``meshes.safetensors.gz`` (read by ``meshes.read_meshes``, which gives :class:`meshot.Mesh`) has, for seed 0 and the
arms under ``kept`` in the configuration, the target, the start and the end of a fit, named ``TARGET/target``,
``TARGET/START/begin`` and ``TARGET/START/LOSS_ENCODING_SUPPORTS``; for ``paths`` also the mesh after each integration
step of the best field, named ``…/path/K``.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import safetensors.torch
import torch
from fitting import Ruler, fit_once, n_supports, planned_arms
from meshes import start_mesh, target_mesh, write_meshes
from summary import differences, summarise

from meshot import Mesh
from meshot.files import whole_file

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

ARM = ("loss", "encoding", "supports")
SETTING = ("target", "start", "seed")


def planned_settings(config: dict) -> list[dict]:
    """All combinations of target, start and seed."""
    settings = []
    for start in ("sphere", "smoothed"):
        for target, of_target in config["targets"].items():
            seeds = config["sphere_seeds"].get(target, of_target["seeds"]) if start == "sphere" else of_target["seeds"]
            settings += [{"target": target, "start": start, "seed": seed} for seed in seeds]
    return settings


def planned_fits(config: dict) -> list[dict]:
    """All combinations of arm and setting."""
    rate = {"learning_rate": config["learning_rate"]}
    return [setting | arm | rate for setting in planned_settings(config) for arm in planned_arms(config)]


def stage(task: dict, config: dict) -> int:
    """The priority of a task, so that a run that is stopped early has finished the most informative tasks."""
    far, slow, full = task["start"] == "sphere", task["loss"] == "sinkhorn", task["supports"] == "full"
    if task["seed"] == config["trials"]["seed"]:
        return 3
    if task["target"] == "folded":
        return (2 if far else 6) if slow else 0
    if far:
        return 7 if full else 9
    if full:
        return 1 if (task["target"], task["seed"]) == ("fsaverage5_left", 0) else 4
    return 5 if task["seed"] == 0 else 8


def planned_trials(config: dict) -> list[dict]:
    """Fits with other learning rates, and with gradients that stop at the areas of drawn faces or not."""
    trials, arms = config["trials"], planned_arms(config)
    setting = {name: trials[name] for name in SETTING}
    of_rates = [arm for arm in arms if arm["loss"] in trials["losses"] and arm["supports"] == "full"]
    of_areas = [arm for arm in arms if arm["encoding"] == "varifold" and arm["supports"] != "full"]
    rate = {"learning_rate": config["learning_rate"]}
    return [setting | arm | {"learning_rate": rate} for arm in of_rates for rate in trials["rates"]] + [
        setting | arm | rate | {"detached": detached} for arm in of_areas for detached in (False, True)
    ]


def work(task: dict, config: dict) -> dict:
    """One fit. Meshes for the chapter are written to a file."""
    found, meshes = fit_once(task, config)
    goal = target_mesh(task["target"], task["seed"], config)
    if is_kept(task, config):
        tensors = {name: mesh.vertices.contiguous() for name, mesh in meshes.items()}
        with whole_file(_kept_at(task, config)) as temporary:
            safetensors.torch.save_file(tensors, temporary)
    return {"n_supports": n_supports(task, goal)} | found


def is_kept(task: dict, config: dict) -> bool:
    """Whether the meshes of a fit are stored."""
    arms = config["kept"].get(f"{task['target']}/{task['start']}", [])
    return task["seed"] == 0 and _name(task) in arms and task["learning_rate"] == config["learning_rate"]


def _name(task: dict) -> str:
    return "_".join(str(task[part]) for part in ARM)


def _kept_at(task: dict, config: experiment.Config) -> Path:
    name = "_".join(str(task[name]) for name in (*SETTING, *ARM))
    return config.place / f"{name}.safetensors"


def describe(setting: dict, config: dict) -> dict:
    """The metrics of the start of a setting, and of the target against itself."""
    goal = target_mesh(setting["target"], setting["seed"], config)
    begin = start_mesh(setting["start"], setting["target"], goal, config)
    values, floors = Ruler(goal, config).all(begin)
    counts = {"n_vertices": len(goal.vertices), "n_faces": len(goal.faces)}
    return setting | counts | {"floor": floors, "begin": values}


def stored_meshes(fits: list[dict], config: dict) -> Iterator[tuple[str, Mesh]]:
    """Targets, starts, ends and paths, by name."""
    for fit in (fit for fit in fits if is_kept(fit, config)):
        place = f"{fit['target']}/{fit['start']}"
        goal = target_mesh(fit["target"], 0, config)
        begin = start_mesh(fit["start"], fit["target"], goal, config)
        yield f"{fit['target']}/target", goal
        yield f"{place}/begin", begin
        tensors = safetensors.torch.load_file(_kept_at(fit, config))
        name = f"{place}/{_name(fit)}"
        yield name, begin.to(torch.float32).with_vertices(tensors["end"])
        for k in range(config["fit"]["n_steps"] + 1) if name in config["paths"] else ():
            yield f"{name}/path/{k}", begin.to(torch.float32).with_vertices(tensors[f"path/{k}"])


def collect(rows: list[dict], trials: list[dict], config: dict) -> dict:
    """The results without the meshes."""
    fits = [row["task"] | row["found"] for row in rows]
    settings = [s for s in planned_settings(config) if any(all(f[k] == v for k, v in s.items()) for f in fits)]
    tried = [
        {k: v for k, v in row["task"].items() if k not in SETTING}
        | {name: row["found"]["end"][name] for name in ("assd", "edge_variation")}
        for row in trials
    ]
    done = [row["task"] for row in rows]
    return {
        "rates": [row for row in tried if "detached" not in row],
        "areas": [row for row in tried if "detached" in row],
        "settings": [describe(setting, config) for setting in settings],
        "fits": fits,
        "summary": summarise(fits),
        "differences": differences(fits),
        "missing": [task for task in planned_fits(config) if task not in done],
    }


def tasks(config: dict) -> list[dict]:
    """All fits, the most informative ones first."""
    return sorted(planned_fits(config) + planned_trials(config), key=lambda task: stage(task, config))


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The results; the meshes are written to their file."""
    of_trials = [row for row in rows if row["task"]["seed"] == config["trials"]["seed"]]
    found = collect([row for row in rows if row not in of_trials], of_trials, config)
    meshes = dict(stored_meshes(found["fits"], config))
    write_meshes(config.output.with_name("meshes.safetensors.gz"), meshes, config["vertex_step"])
    return found


if __name__ == "__main__":
    data = "analytic folded surfaces; fsaverage5 white surfaces (FreeSurfer)"
    experiment.run(__file__, tasks, work, results, data)
