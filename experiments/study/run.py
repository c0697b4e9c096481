"""A study with a known answer: two groups of six synthetic people, two visits each, and the true surfaces.

Every visit is simulated, reconstructed with the networks of the package, and measured.
"""

import dataclasses
import functools
import sys
import time
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh, euler_number, face_areas, signed_volume
from meshot.pipeline import TrainedNetworks, load_networks, reconstruct
from meshot.provenance import rounded
from meshot.synth import (
    Anatomy,
    CorticalSurfaces,
    Position,
    Recipe,
    Shape,
    drawn_appearance,
    drawn_shape,
    read_recipe,
    simulated_scan,
    synthetic_subject,
)

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def tasks_of(config: dict) -> list[dict]:
    """The visits, those of a person one after another."""
    return [
        {"group": group, "person": person, "visit": visit}
        for group in config["groups"]
        for person in range(config["people"])
        for visit in range(config["visits"])
    ]


def labels_of(config: dict) -> dict[tuple[str, int], str]:
    """The label of each person, in an order that does not tell the group."""
    people = [(group, person) for group in config["groups"] for person in range(config["people"])]
    order = np.random.default_rng(config["label_seed"]).permutation(len(people))
    return {people[k]: f"{place + 1:02d}" for place, k in enumerate(order)}


def recipe_of(config: dict, group: str, **other: float) -> Recipe:
    """The recipe of a group, with other parameters of the shape if they are given."""
    base, chosen = read_recipe(config["recipe"]), config["groups"][group]
    own = {"subdivisions": config["subdivisions"], "atrophy": chosen["atrophy"]}
    return dataclasses.replace(
        base,
        name=group,
        seed=chosen["seed"],
        shape=dict(base.shape) | own | other,
        position=dict(base.position) | config["position"],
    )


def visited(task: dict, config: dict) -> dict:
    """One visit: the scan is simulated and reconstructed. The row of the table, and the truth about the person."""
    group, recipe = task["group"], recipe_of(config, task["group"])
    seed = int(np.random.SeedSequence([recipe.seed, task["person"]]).generate_state(1)[0])
    surfaces = surfaces_of(drawn_shape(recipe, "template"), seed)
    scan = simulated_scan(
        surfaces, Anatomy(), drawn_appearance(recipe, seed), Position(**recipe.position), [seed, task["visit"]]
    )
    person = {"participant_id": f"sub-{labels_of(config)[group, task['person']]}", "group": group}
    person |= measured(surfaces.white, "{}_{}") | {"strength": surfaces.strength}
    if config["groups"][group]["atrophy"]:
        before = surfaces_of(drawn_shape(recipe_of(config, group, atrophy=0.0), "template"), seed)
        person |= measured(before.white, "{}_before_{}") | {"strength_before": before.strength}
    started, networks = time.process_time(), networks_of(config["initial_only"])
    found = reconstruct(scan.image, networks.segmentation, networks.system)
    final = {side: surface.final for side, surface in found.surfaces.items()}
    row = {"participant_id": person["participant_id"], "session_id": f"ses-{task['visit'] + 1:02d}", "status": "done"}
    row |= measured(final, "{}_white_{}")
    row |= {f"{side}_white_euler": euler_number(mesh) for side, mesh in final.items()}
    return {"person": person, "row": row | {"seconds": time.process_time() - started, "warnings": len(found.warnings)}}


@functools.lru_cache(maxsize=2)
def surfaces_of(shape: Shape, seed: int) -> CorticalSurfaces:
    """The surfaces of a person; kept for the next visit."""
    return synthetic_subject(shape, seed)


@functools.lru_cache(maxsize=1)
def networks_of(initial_only: bool) -> TrainedNetworks:
    """The networks of the package."""
    return load_networks(initial_only=initial_only)


def measured(meshes: dict[str, Mesh], name: str) -> dict[str, float]:
    """Volume and area of the surfaces of both sides."""
    found = {}
    for side in HEMISPHERES:
        found[name.format(side, "volume_mm3")] = float(signed_volume(meshes[side]))
        found[name.format(side, "area_mm2")] = float(face_areas(meshes[side]).sum())
    return found


def tables(found: list[dict]) -> dict:
    """One row for each person, and one for each visit. The anatomy of both visits is the same."""
    people = {each["person"]["participant_id"]: each["person"] for each in found}
    rows = sorted((each["row"] for each in found), key=lambda row: (row["participant_id"], row["session_id"]))
    return {"people": [people[name] for name in sorted(people)], "visits": rows}


def results(rows: list[dict], config: dict) -> dict:
    """The tables of people and visits."""
    return rounded(tables([row["found"] for row in rows]))


if __name__ == "__main__":
    experiment.run(__file__, tasks_of, visited, results, "synthetic heads made from fsaverage5")
