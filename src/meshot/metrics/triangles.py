"""Regularity of the triangles of a mesh."""

import numpy as np

from meshot.mesh import Mesh
from meshot.mesh.geometry import edge_lengths, face_areas, face_corners
from meshot.types import Array, Float


def edge_length_variation(mesh: Mesh) -> float:
    """The coefficient of variation of the edge lengths: standard deviation over mean; 0 if all are equal."""
    return _variation(edge_lengths(mesh).detach().double().cpu().numpy())


def face_area_variation(mesh: Mesh) -> float:
    """The coefficient of variation of the face areas: standard deviation over mean; 0 if all are equal."""
    return _variation(face_areas(mesh).detach().double().cpu().numpy())


def smallest_angles(mesh: Mesh) -> Float[Array, " F"]:
    """The smallest angle of every face, in degrees: at most 60; 0 for a face without area."""
    corners = face_corners(mesh).detach().double().cpu().numpy()
    sides = np.roll(corners, -1, axis=1) - corners
    doubled_areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    dots = -np.einsum("fik,fik->fi", sides, np.roll(sides, 1, axis=1))
    return np.degrees(np.arctan2(doubled_areas[:, None], dots).min(axis=1))


def _variation(sizes: Float[Array, " n"]) -> float:
    mean = float(sizes.mean())
    return float(sizes.std()) / mean if mean > 0 else 0.0
