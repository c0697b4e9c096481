"""Measure the surfaces of one scan against a third party's estimate of its grey and white matter.

With ``--robustness`` the scan is also turned, resampled, made noisier and so on, and the change of its surfaces is
measured, for ``robustness.json``. The results hold numbers alone, and no image.
"""

import functools
import sys
from pathlib import Path

import numpy as np
import safetensors.torch
from estimate import Estimate, read_estimate
from measures import border_distances, compared_areas, given_up, joined
from regions import registered_labels
from variants import changed_scan

from meshot.anatomy import HEMISPHERES
from meshot.files import whole_file
from meshot.mesh import Mesh, signed_volume
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.model import network_digest
from meshot.pipeline import Reconstruction, TrainedNetworks, load_networks, reconstruct
from meshot.provenance import file_digest, rounded, write_results
from meshot.volume import Volume, read_volume, transform_points

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

FILES = ("scan", "grey", "white")
OPTIONS = {name: (name, {"help": "a file"}) for name in FILES} | {
    "robustness": ("--robustness", {"action": "store_true", "help": "also reconstruct the changed scans"}),
    "segmentation": ("--segmentation", {"help": "weights of the segmentation (default: the package's)"}),
    "weights": ("--weights", {"help": "folder of the weights of the flows (default: the package's)"}),
}


def measured(networks: TrainedNetworks, config: dict, place: Path) -> dict:
    """All numbers of the scan as it is. Its surfaces are written to ``place``."""
    scan, estimate = read_volume(config["scan"]), read_estimate(config["grey"], config["white"])
    require_one_grid(scan, estimate)
    made = reconstruct(scan, networks.segmentation, networks.system)
    for side in HEMISPHERES:
        write_surface(place / f"{side}.safetensors", made.surfaces[side].final)
    labels, _ = registered_labels(scan, estimate.grey.data + estimate.white.data, config["regions"], config["seed"])
    from_mask = np.linalg.inv(made.scan.to_standard)
    mesh = joined([made.surfaces[side].final for side in HEMISPHERES])
    segmented = {side: made.surfaces[side].segmented for side in HEMISPHERES}
    return {
        "border_mm": border_distances(mesh, estimate, labels, config["n_points"], config["seed"]),
        "areas": compared_areas(mesh, estimate, labels),
        "volumes_cm3": {side: float(signed_volume(made.surfaces[side].final)) / 1000 for side in HEMISPHERES},
        "given_up": {
            side: given_up(each.mask, each.genus_zero_mask, labels, from_mask, **config["given_up"])
            for side, each in segmented.items()
        },
        **how_it_went(made),
    }


def compared(name: str, networks: TrainedNetworks, config: dict, place: Path) -> dict:
    """Distances in mm of a changed scan's surfaces, brought back, from those of the scan; or why it was refused."""
    changed = changed_scan(
        *map(read_volume, (config["scan"], config["white"])), config["variants"][name], config["seed"]
    )
    try:
        made = reconstruct(changed.scan, networks.segmentation, networks.system)
    except ValueError as error:
        return {"refused": str(error)}
    found = {}
    for side in HEMISPHERES:
        seen = HEMISPHERES[1 - HEMISPHERES.index(side)] if changed.mirrors() else side
        mesh = made.surfaces[seen].final
        back = mesh.with_vertices(transform_points(changed.to_person, mesh.vertices.double()))
        before = read_surface(place / f"{side}.safetensors")
        draws = (config["seed"], config["seed"] + 1)
        offsets = offsets_between(Surface(back), Surface(before), config["n_points"], draws)
        found[side] = {"assd": average_surface_distance(*offsets), "hausdorff90": hausdorff_distance(*offsets)}
    return {"change_mm": found, **how_it_went(made)}


def how_it_went(made: Reconstruction) -> dict:
    """Warnings of a reconstruction, and the seconds of its stages."""
    return {
        "warnings": [warning.text for warning in made.warnings],
        "warning_names": [warning.name for warning in made.warnings],
        "seconds": {"clock": made.wall_seconds, "processor": made.cpu_seconds},
    }


def require_one_grid(scan: Volume, estimate: Estimate) -> None:
    """Check that scan and estimate share a grid."""
    if scan.data.shape != estimate.white.data.shape or not np.allclose(scan.affine, estimate.white.affine, atol=1e-3):
        raise ValueError(
            f"the scan is {scan} and its estimate {estimate.white}, or their affines differ: both must share one grid; "
            "resample the estimate to the grid of the scan"
        )


def write_surface(path: Path, mesh: Mesh) -> None:
    """Write a mesh, whole or not at all."""
    with whole_file(path) as temporary:
        safetensors.torch.save_file(
            {"vertices": mesh.vertices.contiguous(), "faces": mesh.faces.contiguous()}, temporary
        )


def read_surface(path: Path) -> Mesh:
    """A mesh that :func:`write_surface` wrote."""
    return Mesh(**safetensors.torch.load_file(path))


@functools.cache
def networks_of(config: dict) -> TrainedNetworks:
    """The networks."""
    return load_networks(weights=config.get("weights"), segmentation=config.get("segmentation"))


@functools.cache
def inputs_of(config: dict) -> dict:
    """Digests of the files and of the networks, which identify stored parts."""
    networks = networks_of(config)
    parts = {} if networks.system is None else networks.system.parts
    return {
        "files": {name: file_digest(Path(config[name])) for name in FILES},
        "networks": {"segmentation": network_digest(networks.segmentation)}
        | {name: network_digest(part.network) for name, part in parts.items()},
    }


def depends(config: dict) -> dict:
    """The settings, and the digests of files and networks in place of their names."""
    return {key: value for key, value in config.items() if key not in OPTIONS} | inputs_of(config)


def tasks(config: dict) -> list[dict]:
    """The scan, and its variants."""
    return [{"variant": name} for name in [None, *(config["variants"] if config["robustness"] else [])]]


def work(task: dict, config: experiment.Config) -> dict:
    """The numbers of the scan, or of a variant. The scan comes first."""
    if task["variant"] is None:
        return measured(networks_of(config), config, config.place)
    return compared(task["variant"], networks_of(config), config, config.place)


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The numbers of the scan; those of the variants are written to a file of their own."""
    first, *others = rows
    if config["robustness"]:
        changes = rounded(
            {"inputs": inputs_of(config)} | {"variants": {r["task"]["variant"]: r["found"] for r in others}}
        )
        stated = {key: value for key, value in config.items() if key not in OPTIONS}
        seconds = sum(row["seconds"] for row in others)
        command = "python experiments/person/run.py SCAN GREY WHITE --robustness"
        write_results(config.output.with_name("robustness.json"), changes, stated, command, data(config), seconds)
    return rounded({"inputs": inputs_of(config), "scan": first["found"]})


def data(config: dict) -> str:
    """Whose scan it is."""
    known = inputs_of(config)["files"] == config["source"]["sha256"]
    return f"a person: {config['source']['name']}" if known else "a person: files of one's own, see the digests"


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, data, OPTIONS, depends)
