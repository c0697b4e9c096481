"""Measure the surfaces of S1, one adult, against those that FreeSurfer found in the same scan.

``make person`` fetches the scan and runs this. Measured are the networks of the package: after the repair of crossing
faces, before it, and before the flow. Beside them stand CortexODE, trained on the same heads, and CAT, a classical
program, whose surfaces ``benchmarks/cat_surfaces.py`` writes. A peer without its files is left out.

``results.json`` has a row for each side of each of these, with distances in mm to FreeSurfer's white surface: the
symmetric mean ("assd_mm"), the 90th percentile, the share of points beyond 2 mm, and the mean signed distance
("signed_mm", negative inside). Those with "cortex" in their name count points beside the cortex alone: FreeSurfer's
flat maps leave out the medial wall, and some cuts. Areas and volumes are compared in percent.

If the networks find pial surfaces, these have a row, too, against FreeSurfer's pial surface. ``thickness`` has the mean
of both programs, by the same formula, and by region. The template that was carried to our surface divides both.
"""

import functools
import json
import resource
import sys
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere, desikan_killiany
from meshot.mesh import Mesh, face_areas, read_mesh, self_intersecting_faces, signed_volume
from meshot.metrics import Surface, offsets_between
from meshot.model import network_digest
from meshot.pipeline import (
    TrainedNetworks,
    load_networks,
    reconstruct,
    region_numbers,
    vertex_regions,
)
from meshot.provenance import file_digest, rounded
from meshot.synth import crossing_faces
from meshot.volume import read_volume

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

#: What is measured: the result, and the surface before the repair and before the flow.
STAGES = ("final", "unrepaired", "initial")


@functools.cache
def networks_of(name: str, config: dict) -> TrainedNetworks:
    """The networks of a task."""
    return load_networks(**config["networks"][name])


@functools.cache
def reference(side: str, config: dict, kind: str = "white") -> tuple[Surface, np.ndarray]:
    """FreeSurfer's surface of a side, in scanner RAS, and which of its faces are beside the cortex."""
    place, letter = Path(config["folder"]), side[0]
    # The headers name no space. The coordinates are scanner RAS: almost all vertices are brighter inside than outside.
    mesh = read_mesh(place / f"{letter}h.{kind}.gii")
    cortex = np.zeros(len(mesh.vertices), dtype=bool)
    cortex[read_mesh(place / f"{letter}h.flat.gii").faces.numpy()] = True
    return Surface(mesh), cortex[mesh.faces.numpy()].all(axis=1)


def thickness_rows(pairs: dict[str, tuple[Mesh, Mesh]], carried: Mesh, side: Hemisphere) -> dict:
    """The mean thickness of the cortex of a side and by region, in mm, of all programs by the same formula.

    ``pairs`` has the white and the pial surface of each program, and among them those of the reference.
    """
    atlas, row = desikan_killiany(side), {}
    for name, (white, pial) in pairs.items():
        regions = region_numbers(white, vertex_regions(white, carried, atlas), atlas, pial)
        areas = np.array([each["area_mm2"] for each in regions])
        values = np.array([each["thickness_mm"] for each in regions])
        row[name] = {"mean_mm": float(values @ areas / areas.sum())}
        row[name]["regions"] = {each["region"]: each["thickness_mm"] for each in regions}
    theirs = row["reference"]["regions"]
    for name in pairs.keys() - {"reference"}:
        own = row[name]["regions"]
        both = [region for region in theirs if region in own]
        values = [[of[region] for region in both] for of in (own, theirs)]
        row[name]["correlation_of_regions"] = float(np.corrcoef(*values)[0, 1])
    return row


def peer_surfaces(config: dict, side: Hemisphere) -> dict[str, tuple[Mesh, Mesh]]:
    """The white and the pial surface that other programs wrote, by the name of the program."""
    found = {}
    for name, folder in config["peers"].items():
        paths = [Path(folder) / f"{side[0]}h.{kind}.gii" for kind in ("white", "pial")]
        if all(path.is_file() for path in paths):
            found[name] = tuple(read_mesh(path) for path in paths)
    return found


def compared(mesh: Mesh, truth: Surface, cortex: np.ndarray, config: dict) -> dict:
    """The measures of a white surface."""
    found, n, draws = Surface(mesh), config["n_points"], (config["seed"], config["seed"] + 1)
    samples = [each.sample(n, draw).points for each, draw in zip((found, truth), draws, strict=True)]
    distances = [each.distances for each in offsets_between(found, truth, n, draws)]
    signed = truth.signed_distances(samples[0])
    everywhere = [np.ones(n, dtype=bool)] * 2
    beside = [cortex[truth.nearest_faces(points)] for points in samples]
    row = {}
    for place, parts in (("", everywhere), ("_cortex", beside)):
        there, back = (each[part] for each, part in zip(distances, parts, strict=True))
        row |= {
            f"assd{place}_mm": float(there.mean() + back.mean()) / 2,
            f"hausdorff90{place}_mm": float(max(np.quantile(there, 0.9), np.quantile(back, 0.9))),
            f"beyond{place}_percent": 50 * float(sum((each > config["beyond_mm"]).mean() for each in (there, back))),
            f"signed{place}_mm": float(signed[parts[0]].mean()),
        }
    areas, volumes = ([f(each) for each in (mesh, truth.mesh)] for f in (lambda m: face_areas(m).sum(), signed_volume))
    return row | {
        "area_percent": 100 * float(areas[0] / areas[1] - 1),
        "volume_percent": 100 * float(volumes[0] / volumes[1] - 1),
        "crossing_percent": 100 * len(self_intersecting_faces(mesh)) / len(mesh.faces),
    }


def work(task: dict, config: experiment.Config) -> dict:
    """All rows of one set of networks; those of the package stand beside the surfaces of the peers."""
    networks = networks_of(task["of"], config)
    scan, has_pial = read_volume(Path(config["folder"]) / "scan.nii.gz"), ("left", "pial") in networks.system.surfaces
    made = reconstruct(scan, networks.segmentation, networks.system, correspondence=has_pial)
    rows, thickness = [], {}
    for side in HEMISPHERES:
        found = made.surfaces[side]
        for stage in STAGES:
            row = {"of": task["of"], "stage": stage, "side": side}
            row |= compared(getattr(found, stage), *reference(side, config), config)
            if stage == "final" and found.repaired is not None:
                row["crossing_before_repair_percent"] = 100 * found.repaired.n_crossing / len(found.final.faces)
                row["largest_repair_mm"] = found.repaired.largest_move
            rows.append(row)
        if not has_pial:
            continue
        theirs = tuple(reference(side, config, kind)[0].mesh for kind in ("white", "pial"))
        pairs = {task["of"]: (found.final, found.pial)} | peer_surfaces(config, side)
        for name, meshes in pairs.items():
            for kind, stage, mesh in zip(("white", "pial"), ("final", "pial"), meshes, strict=True):
                if (name, stage) != (task["of"], "final"):
                    row = compared(mesh, *reference(side, config, kind), config)
                    rows.append({"of": name, "stage": stage, "side": side} | row)
        thickness[side] = thickness_rows(pairs | {"reference": theirs}, found.carried.mesh, side)
    four = [mesh for each in made.surfaces.values() for mesh in (each.final, each.pial) if mesh is not None]
    return {
        "rows": rounded(rows),
        "thickness": rounded(thickness),
        "crossing_among_all": len(crossing_faces(four)),
        "warnings": [{"name": each.name, "text": each.text} for each in made.warnings],
        "seconds": rounded({"clock": made.wall_seconds, "processor": made.cpu_seconds}),
        "peak_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }


def inputs_of(config: dict) -> dict:
    """Digests of the scan and of all networks."""
    digests = {}
    for name in config["networks"]:
        networks = networks_of(name, config)
        parts = {"segmentation": networks.segmentation} | {k: p.network for k, p in networks.system.parts.items()}
        digests[name] = {part: network_digest(each) for part, each in parts.items()}
    return {"scan": file_digest(Path(config["folder"]) / "scan.nii.gz"), "networks": digests}


def results(rows: list[dict], config: dict) -> dict:
    """The rows of all networks and peers, and what each set of networks said of the scan."""
    found = {row["task"]["of"]: row["found"] for row in rows}
    records = {name: Path(folder) / f"{name}.json" for name, folder in config["peers"].items()}
    return {
        "inputs": inputs_of(config),
        "rows": [row for each in found.values() for row in each["rows"]],
        "scans": {name: {key: each[key] for key in each.keys() - {"rows"}} for name, each in found.items()},
        "peers": {name: json.loads(path.read_text()) for name, path in records.items() if path.is_file()},
    }


def depends(config: dict) -> dict:
    """The settings, and the digests of the scan and of the networks."""
    return dict(config) | inputs_of(config)


def tasks(config: dict) -> list[dict]:
    """Every set of networks."""
    return [{"of": name} for name in config["networks"]]


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, lambda config: config["source"]["name"], depends=depends)
