"""Measure the surfaces of one scan against a third party's estimate of its grey and white matter.

Run as ``python experiments/person/run.py SCAN GREY WHITE``; with ``--robustness`` the scan is also turned, resampled,
made noisier and so on, and the change of its surfaces is measured. ``--segmentation`` and ``--weights`` replace the
networks of the package, ``--output`` the folder of the results. Every finished part is stored, so that a stopped run
can be resumed. The results hold numbers alone, and no image.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np
import safetensors.torch
import torch
import yaml
from estimate import Estimate, read_estimate
from measures import border_distances, compared_areas, given_up, joined
from regions import registered_labels
from variants import changed_scan

from meshot.anatomy import HEMISPHERES
from meshot.files import whole_file
from meshot.jobs import fingerprint, run_jobs
from meshot.mesh import Mesh, signed_volume
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.model import network_digest
from meshot.pipeline import Reconstruction, TrainedNetworks, load_networks, reconstruct, warning_names
from meshot.provenance import file_digest, rounded, write_results
from meshot.volume import Volume, read_volume, transform_points

HERE = Path(__file__).resolve().parent
COMMAND = "python experiments/person/run.py SCAN GREY WHITE"


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("scan", "grey", "white"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--robustness", action="store_true", help="also reconstruct the changed scans")
    parser.add_argument("--segmentation", type=Path, help="weights of the segmentation (default: the package's)")
    parser.add_argument("--weights", type=Path, help="folder of the weights of the flows (default: the package's)")
    parser.add_argument("--output", type=Path, default=HERE, help="folder of the results")
    return parser.parse_args(words)


def measured(asked: argparse.Namespace, networks: TrainedNetworks, config: dict, place: Path) -> dict:
    """All numbers of the scan as it is. Its surfaces are written to ``place``."""
    scan, estimate = read_volume(asked.scan), read_estimate(asked.grey, asked.white)
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


def compared(name: str, asked: argparse.Namespace, networks: TrainedNetworks, config: dict, place: Path) -> dict:
    """Distances in mm of a changed scan's surfaces, brought back, from those of the scan; or why it was refused."""
    changed = changed_scan(read_volume(asked.scan), read_volume(asked.white), config["variants"][name], config["seed"])
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
        "warnings": list(made.warnings),
        "warning_names": warning_names(made.warnings),
        "seconds": {"clock": made.wall_seconds, "processor": made.cpu_seconds},
    }


def require_one_grid(scan: Volume, estimate: Estimate) -> None:
    """Check that scan and estimate share a grid.

    Raises
    ------
    ValueError
        If they do not.
    """
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


def inputs_of(asked: argparse.Namespace, networks: TrainedNetworks) -> dict:
    """Digests of the files and of the networks, which identify stored parts."""
    parts = {} if networks.system is None else networks.system.parts
    return {
        "files": {name: file_digest(getattr(asked, name)) for name in ("scan", "grey", "white")},
        "networks": {"segmentation": network_digest(networks.segmentation)}
        | {name: network_digest(part.network) for name, part in parts.items()},
    }


def main(words: list[str] | None = None) -> None:
    """Measure the missing parts, then write the results."""
    asked = parsed(words)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    torch.set_num_threads(config["n_threads"])
    networks = load_networks(weights=asked.weights, segmentation=asked.segmentation)
    inputs = inputs_of(asked, networks)
    known = inputs["files"] == config["source"]["sha256"]
    partial = asked.output / "partial"
    place = partial / fingerprint(HERE, config | inputs)
    place.mkdir(parents=True, exist_ok=True)

    def work(task: dict) -> dict:
        if task["variant"] is None:
            return measured(asked, networks, config, place)
        return compared(task["variant"], asked, networks, config, place)

    tasks = [{"variant": name} for name in [None, *(config["variants"] if asked.robustness else [])]]
    rows = run_jobs(tasks, work, partial / "tasks.jsonl", folder=HERE, config=config | inputs)
    first, *others = rows
    data = f"a person: {config['source']['name']}" if known else "a person: files of one's own, see the digests"
    results = rounded({"inputs": inputs, "scan": first["found"]})
    write_results(asked.output / "results.json", results, config, COMMAND, data, first["seconds"])
    if asked.robustness:
        changes = {row["task"]["variant"]: row["found"] for row in others}
        results = rounded({"inputs": inputs, "variants": changes})
        seconds = sum(row["seconds"] for row in others)
        path = asked.output / "robustness.json"
        write_results(path, results, config, f"{COMMAND} --robustness", data, seconds)
    shutil.rmtree(partial)


if __name__ == "__main__":
    main()
