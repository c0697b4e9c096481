"""Statistics of a reconstruction that need no ground truth, as plain numbers for JSON."""

from collections.abc import Mapping

import numpy as np

from meshot.mesh import Mesh
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.mesh.topology import self_intersecting_faces, topology
from meshot.metrics import vertex_distances
from meshot.pipeline.correspondence import CarriedTemplate
from meshot.pipeline.quality_warnings import voxels_given_up
from meshot.pipeline.reconstruction import HemisphereSurface
from meshot.types import Array, Float
from meshot.volume import Volume, voxel_sizes


def numbers_of_scan(scan: Volume, name: str) -> dict:
    """Name, size, value range and affine of a scan.

    Parameters
    ----------
    scan : Volume
    name : str
        The name of its file.
    """
    return {
        "name": name,
        "n_voxels": list(scan.data.shape),
        "voxel_mm": voxel_sizes(scan).round(4).tolist(),
        "lowest_value": float(scan.data.min()),
        "highest_value": float(scan.data.max()),
        "affine": scan.affine.tolist(),
    }


def numbers_of_surface(surface: HemisphereSurface, distances: Float[Array, " V"]) -> dict:
    """Statistics of one hemisphere: all meshes, distances between them, and the repair.

    Parameters
    ----------
    surface : HemisphereSurface
    distances : array
        Distance of every vertex of the final surface from the initial one, in mm.
    """
    n_lost, share = voxels_given_up(surface.segmented)
    repaired = surface.repaired
    return {
        "initial": _counts(surface.initial) | _measures(surface.initial),
        "final": _counts(surface.final) | _measures(surface.final),
        "distance_from_initial_mm": _of_distances(distances),
        "pial": None if surface.pial is None else _of_pial(surface.pial, surface.final),
        "fsaverage5": None if surface.carried is None else _of_template(surface.carried),
        "n_voxels_given_up": n_lost,
        "share_of_voxels_given_up": share,
        "repair": None
        if repaired is None
        else {
            "n_faces_crossing_before": repaired.n_crossing,
            "n_backtracks": repaired.n_backtracks,
            "largest_move_mm": repaired.largest_move,
        },
    }


def _of_pial(pial: Mesh, white: Mesh) -> dict:
    distances = {"distance_from_white_mm": _of_distances(vertex_distances(pial, white))}
    return _counts(pial) | _measures(pial) | distances


def _of_distances(distances: Float[Array, " V"]) -> dict:
    return {
        "mean": float(distances.mean()),
        "percentile_95": float(np.percentile(distances, 95)),
        "largest": float(distances.max()),
    }


def _of_template(carried: CarriedTemplate) -> dict:
    return {
        "n_vertices": len(carried.mesh.vertices),
        "distance_mm": carried.distance_mm,
        "n_faces_crossing_before": carried.n_crossing_before,
        "n_self_intersecting_faces": carried.n_crossing,
    }


def _counts(mesh: Mesh) -> dict:
    found = topology(mesh)
    return {
        "n_vertices": len(mesh.vertices),
        "n_faces": len(mesh.faces),
        "euler_number": found.euler_number,
        "n_components": found.n_components,
        "n_boundary_edges": found.n_boundary_edges,
        "n_nonmanifold_edges": found.n_nonmanifold_edges,
    }


def _measures(mesh: Mesh) -> dict:
    return {
        "n_self_intersecting_faces": len(self_intersecting_faces(mesh)),
        "volume_cm3": float(signed_volume(mesh)) / 1000,
        "area_cm2": float(face_areas(mesh).sum()) / 100,
    }


def seconds_by_stage(seconds: Mapping[str, float]) -> str:
    """The time of each stage and the total, such as ``registration 3.1 s, white matter 0.4 s, total 3.5 s``.

    Parameters
    ----------
    seconds : mapping
        By stage.
    """
    parts = [f"{stage} {value:.1f} s" for stage, value in seconds.items()]
    return ", ".join([*parts, f"total {sum(seconds.values()):.1f} s"])
