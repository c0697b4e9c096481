"""Compare the descent direction of each loss on initial surfaces with the displacement that is needed.

The length of the normals was chosen with this experiment. Run as ``python experiments/ddot/descent_directions.py`` when
both cohorts and the segmentation weights exist. It uses validation subjects only and no trained network, and takes two
minutes on one core.
"""

import sys
import time
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from meshot.loss import SurfaceLoss, surface_loss
from meshot.mesh import Mesh, face_areas, vertex_areas, vertex_normals
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.pipeline import InitialSurfaces
from meshot.provenance import rounded, write_results
from meshot.synth import scans
from meshot.systems import DeformationExample, hemisphere_example
from meshot.types import Float, Tensor
from meshot_book.measurements import grouped

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.training import arguments, read_config, segmentation_network

Arrows = Float[Tensor, "vertex 3"]


def needed(mesh: Mesh, target: Surface) -> Arrows:
    """The displacement of every vertex along its normal towards the nearest point of the target, in mm."""
    places = target.tree.squared_distance(target.vertices, target.faces, mesh.vertices.numpy())[2]
    normals = vertex_normals(mesh)
    return ((torch.from_numpy(places) - mesh.vertices) * normals).sum(dim=1, keepdim=True) * normals


def descent_direction(loss: SurfaceLoss, mesh: Mesh, target: Mesh, draw: int) -> Arrows:
    """The negative gradient of a loss at every vertex, divided by the area of the vertex."""
    moving = mesh.vertices.clone().requires_grad_()
    value = loss(mesh.with_vertices(moving), target, np.random.default_rng(draw))
    (slope,) = torch.autograd.grad(value, moving)
    return -slope / vertex_areas(mesh)[:, None]


def cosine(first: Arrows, second: Arrows, masses: Tensor) -> float:
    """The cosine between two vector fields, weighted by the area of the vertices."""
    first, second = (arrows * masses.sqrt()[:, None] for arrows in (first, second))
    return float((first * second).sum() / (first.norm() * second.norm()))


def affine_share(arrows: Arrows, mesh: Mesh, masses: Tensor) -> float:
    """The fraction of the squared vectors that one affine map of the whole surface explains."""
    weights = masses.sqrt()[:, None]
    design = torch.cat([torch.ones_like(weights), mesh.vertices - mesh.vertices.mean(dim=0)], dim=1) * weights
    wanted = arrows * weights
    fitted = design @ torch.linalg.lstsq(design, wanted).solution
    return float((fitted**2).sum() / (wanted**2).sum())


def initial_distance(example: DeformationExample, n_points: int) -> float:
    """ASSD of the initial surface, in mm of the standard space, as in the validation of a training."""
    return average_surface_distance(*offsets_between(Surface(example.initial), Surface(example.target), n_points))


def measured(example: DeformationExample, losses: dict[str, SurfaceLoss], n_points: int) -> list[dict]:
    """One row per loss, for one hemisphere."""
    mesh, target = example.coarse.to(torch.float64), example.target.to(torch.float64)
    way, masses = needed(mesh, Surface(target)), vertex_areas(mesh)
    share = float(face_areas(example.initial).sum() / face_areas(target).sum())
    distance = initial_distance(example, n_points)
    rows = []
    for name, loss in losses.items():
        one, other = (descent_direction(loss, mesh, target, draw) for draw in (0, 1))
        rows.append(
            {
                "subject": example.name,
                "loss": name,
                "cosine": cosine(one, way, masses),
                "cosine_of_two_draws": cosine(one, other, masses),
                "affine_share": affine_share(one, mesh, masses),
                "affine_share_of_needed": affine_share(way, mesh, masses),
                "area_over_target": share,
                "initial_assd_mm": distance,
            }
        )
    return rows


def main(words: list[str] | None = None) -> int:
    """Measure and write the results."""
    asked = arguments(__doc__, Path(__file__).parent, "descent_directions.json").parse_args(words)
    config = read_config(asked.config)
    settings, started = config["descent_directions"], time.process_time()
    torch.set_num_threads(config["evaluation"]["n_threads"])
    surfaces = InitialSurfaces(config["initial"], segmentation_network(config))
    losses = {name: surface_loss(values) for name, values in settings["losses"].items()}
    subjects = [s for cohort in config["cohorts"].values() for s in scans(cohort, settings["split"])]
    rows = []
    for subject in tqdm(subjects, desc="initial surfaces"):
        keys = [(settings["side"], "white")]
        example = hemisphere_example(surfaces.example(subject, keys, keys), settings["side"], settings["n_faces"])
        rows += measured(example, losses, settings["n_points"])
    data = f"{settings['split']} subjects of the synthetic cohorts {', '.join(config['cohorts'])}"
    names = [key for key in rows[0] if key not in ("subject", "loss")]
    means = [
        {"loss": part[0]["loss"]} | {name: float(np.mean([row[name] for row in part])) for name in names}
        for part in grouped(rows, ("loss",))
    ]
    command, seconds = "python experiments/ddot/descent_directions.py", time.process_time() - started
    write_results(asked.output, rounded({"rows": rows, "means": means}), settings, command, data, seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
