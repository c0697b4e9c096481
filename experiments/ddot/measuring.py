"""Measurements of one hemisphere of a held-out subject in scanner space: before a flow, after it, and repaired.

Errors are also localised, in bins of the true surface by sulcal depth and by mean curvature.
"""

import dataclasses
import time

import numpy as np
import torch

from meshot.anatomy import Hemisphere
from meshot.flow import repair_crossings
from meshot.mesh import Mesh, cotangent_vectors, neighbour_means, vertex_areas, vertex_normals
from meshot.metrics import Evaluation, evaluate, vertex_distances
from meshot.model import DeformationNetwork
from meshot.pipeline import InitialSurfaces, in_scanner
from meshot.synth import Subject
from meshot.systems import deformed
from meshot.types import Array, Float, Int64, Tensor
from meshot.volume import StandardScan, Volume, sample_volume, signed_distance, voxel_distance
from meshot_book.measurements import METRICS, metric_values

FLOORS = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "normals")
CURVATURE_ROUNDS = 3  # of averaging over neighbours, since values at single vertices are noisy


@dataclasses.dataclass(frozen=True, eq=False)
class Places:
    """A true surface, with the bin and the area of each vertex."""

    mesh: Mesh
    areas: Float[Array, " V"]
    by_depth: Int64[Array, " V"]
    by_curvature: Int64[Array, " V"]
    n_bins: tuple[int, int]

    def shares(self) -> dict[str, list[float]]:
        """The fraction of the area in each bin."""
        return {name: (np.bincount(bins, self.areas, n) / self.areas.sum()).tolist() for name, bins, n in self._parts()}

    def errors(self, predicted: Mesh) -> dict[str, list[float | None]]:
        """The mean distance from the true surface to a predicted one in each bin, in mm; None for an empty bin."""
        distances, found = vertex_distances(self.mesh, predicted), {}
        for name, bins, n in self._parts():
            areas = np.bincount(bins, self.areas, n)
            sums = np.bincount(bins, self.areas * distances, n)
            found[name] = [float(s / a) if a > 0 else None for s, a in zip(sums, areas, strict=True)]
        return found

    def _parts(self) -> list[tuple[str, Array, int]]:
        return [("by_depth", self.by_depth, self.n_bins[0]), ("by_curvature", self.by_curvature, self.n_bins[1])]


def places(mesh: Mesh, settings: dict) -> Places:
    """The bins of a true surface, with the edges given in the configuration."""
    mesh = mesh.with_vertices(mesh.vertices.double())
    depths = sulcal_depths(mesh, settings["closing_mm"], settings["closing_voxel_mm"]).numpy()
    curvatures = signed_curvatures(mesh).numpy()
    edges = settings["depth_edges_mm"], settings["curvature_edges"]
    by_depth, by_curvature = (np.digitize(v, e) for v, e in zip((depths, curvatures), edges, strict=True))
    return Places(mesh, vertex_areas(mesh).numpy(), by_depth, by_curvature, tuple(len(e) + 1 for e in edges))


def sulcal_depths(mesh: Mesh, radius: float, voxel: float) -> Float[Tensor, " V"]:
    """The depth of every vertex below the hull of the surface, in mm.

    The hull is the morphological closing by a ball that rolls over the outside. The depth of a vertex is its distance
    from the nearest possible centre of the ball, minus the radius. It is about 0 on the crown of a gyrus, and accurate
    to about a voxel.
    """
    margin = radius + 3 * voxel
    low, high = (f(mesh.vertices, dim=0).values.numpy() for f in (torch.min, torch.max))
    shape = np.ceil((high - low + 2 * margin) / voxel).astype(int) + 1
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = low - margin
    grid = Volume(np.zeros(shape, dtype=np.uint8), affine)
    outward = voxel_distance(mesh, grid)
    to_centres = signed_distance(grid.with_data(-outward), -radius)
    return -sample_volume(to_centres, mesh.vertices) - radius


def signed_curvatures(mesh: Mesh) -> Float[Tensor, " V"]:
    """The mean curvature at every vertex, averaged over neighbours, per mm: 1/r on a sphere, negative in a fundus."""
    sums, _ = cotangent_vectors(mesh)
    values = -(sums * vertex_normals(mesh)).sum(dim=1) / (2 * vertex_areas(mesh))
    for _ in range(CURVATURE_ROUNDS):
        means = neighbour_means(mesh.with_vertices(values[:, None].expand(-1, 3).contiguous()))[:, 0]
        values = (values + means) / 2
    return values


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """A hemisphere: scan and initial surface in standard space; the true surface in scanner space, with its bins."""

    scan: StandardScan
    initial: Mesh
    truth: Places


def seen(subject: Subject, side: Hemisphere, surfaces: InitialSurfaces, settings: dict) -> Seen:
    """Read a hemisphere. Its initial surface is computed if it does not exist."""
    truth = places(subject.surface("white", side), settings)
    return Seen(subject.standard(), surfaces.of(subject, side), truth)


def initial_row(found: Seen, settings: dict) -> dict:
    """Metrics of the initial surface, floors of the metrics, and the fraction of the area in each bin."""
    evaluation = evaluated(found.initial, found, settings)
    floors = {key: getattr(evaluation, METRICS[key]).floor for key in FLOORS}
    measured = metric_values(evaluation) | found.truth.errors(in_scanner(found.initial, found.scan))
    return {"measured": measured, "floors": floors, "share": found.truth.shares(), "n_faces": len(found.initial.faces)}


def flow_row(found: Seen, network: DeformationNetwork, training: dict, settings: dict) -> dict:
    """Metrics of the surface after a flow, as it is (``flow``) and after repair of intersections (``repaired``)."""
    started = time.process_time()
    carried = deformed(found.initial, found.scan.volume, network, training["n_flow_steps"], training["method"])
    flowed = time.process_time()
    result = repair_crossings(found.initial, carried)
    seconds = {"cpu_seconds_flow": flowed - started, "cpu_seconds_repair": time.process_time() - flowed}
    last = metric_values(evaluated(result.mesh, found, settings))
    return {
        "flow": metric_values(evaluated(carried, found, settings)) if result.n_crossing else last,
        "repaired": last | found.truth.errors(in_scanner(result.mesh, found.scan)),
        "n_backtracks": result.n_backtracks,
        "largest_move_mm": result.largest_move,
    } | seconds


def evaluated(mesh: Mesh, found: Seen, settings: dict) -> Evaluation:
    """All metrics between a mesh of the standard space and the true surface, in scanner space."""
    return evaluate(
        in_scanner(mesh, found.scan), found.truth.mesh, settings["n_points"], settings["seed"],
        settings["n_emd_points"],
    )  # fmt: skip
