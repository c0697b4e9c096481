"""Miniature subjects for chapter 21: two small hemispheres, each with a thin gyrus and two sulci that are hard to find.

In the frame of a hemisphere, x points to the middle of the head, y to the front and z upwards. The frame of the right
hemisphere is reflected. Every hemisphere is a ball with a blade on its top (the thin gyrus), a slit at its side that is
narrower than a voxel (the buried sulcus), and a wider slit at its bottom. In the image, not on the true surface, a
bright bridge joins the banks of this last slit.
"""

import dataclasses

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.mesh import Mesh, taubin_smoothing
from meshot.metrics import vertex_distances
from meshot.rng import numpy_generator
from meshot.systems import Example, Scan
from meshot.types import Array, Bool, Float, Tensor
from meshot.volume import Volume, enclosed_fractions, isosurface, voxel_to_mm
from meshot_book.tissue import tissue_surface

#: The features of a hemisphere, as they are named in tables.
FEATURES = ("thin gyrus", "buried sulcus", "bridged sulcus")
_SHAPE, _SIZES = (40, 24, 28), np.array([1.5, 208 / 144, 1.5])  # as on the standard grid, in mm
_CENTRES = {"left": np.array([-15.0, 0, 0]), "right": np.array([15.0, 0, 0])}
_FINE = 0.6  # mm, spacing of the grid on which a true surface is found
_NOISE = 0.03


@dataclasses.dataclass(frozen=True)
class Folds:
    """Where the features of a hemisphere are, in mm in its frame.

    Parameters
    ----------
    gyrus, bridged : float
        The x coordinate of the thin gyrus and of the bridged sulcus.
    buried : float
        The z coordinate of the buried sulcus.
    """

    gyrus: float = 0.0
    buried: float = 0.0
    bridged: float = 0.0

    def near(self, feature: str, places: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
        """Which positions belong to a feature: in the blade, or in a slit and up to half a millimetre beside it.

        Raises
        ------
        ValueError
            If there is no such feature.
        """
        x, y, z = places.unbind(dim=1)
        if feature == "thin gyrus":
            return ((x - self.gyrus).abs() < 1.2) & (y.abs() < 4.5) & (z > 9.5)
        if feature == "buried sulcus":
            return ((z - self.buried).abs() < 0.9) & (y.abs() < 4.5) & (x < -3) & (x > -7.5)
        if feature == "bridged sulcus":
            return ((x - self.bridged).abs() < 1.5) & (y.abs() < 4.5) & (z < -4) & (z > -7.5)
        raise ValueError(f"there is no feature {feature!r}; name one of {', '.join(FEATURES)}")


def folded_ball(folds: Folds) -> Mesh:
    """The true surface of a hemisphere in its frame: closed, of genus 0, in mm."""
    ticks = np.arange(-13.2, 13.2 + _FINE / 2, _FINE)
    affine = np.diag([_FINE, _FINE, _FINE, 1.0])
    affine[:3, 3] = ticks[0]
    places = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"))
    ball = np.linalg.norm(places / np.array([1, 1.15, 1]).reshape(3, 1, 1, 1), axis=0) - 8.5
    blade = _to_box(places, (folds.gyrus, 0, 9.5), (0.1, 4, 2.5), 0.5)
    buried = _to_box(places, (-7.0, 0, folds.buried), (3.6, 4, 0), 0.35)
    bridged = _to_box(places, (folds.bridged, 0, -7.5), (0.5, 4.5, 3.2), 0.5)
    inside = -_smooth_minimum(ball, blade, 0.8)
    for slit, width in ((buried, 0.3), (bridged, 0.6)):
        inside = _smooth_minimum(inside, slit, width)
    return taubin_smoothing(isosurface(Volume(inside, affine), 0.0), 3)


def _to_box(
    places: Float[Array, "3 x y z"], centre: tuple[float, float, float], half: tuple[float, float, float], radius: float
) -> Float[Array, "x y z"]:
    """Signed distances from a box with rounded edges."""
    beyond = np.abs(places - np.reshape(centre, (3, 1, 1, 1))) - np.reshape(half, (3, 1, 1, 1))
    return np.linalg.norm(np.maximum(beyond, 0), axis=0) + np.minimum(beyond.max(axis=0), 0) - radius


def _smooth_minimum(first: Float[Array, "x y z"], second: Float[Array, "x y z"], width: float) -> Float[Array, "x y z"]:
    """The minimum of two fields, rounded where they differ by less than ``width``."""
    share = np.clip(0.5 + 0.5 * (second - first) / width, 0, 1)
    return second + (first - second) * share - width * share * (1 - share)


@dataclasses.dataclass(frozen=True, eq=False)
class Miniature:
    """A miniature subject.

    Parameters
    ----------
    example : Example
        Scan, initial surfaces of both sides, and true surfaces, in float32.
    folds : dict
        Where the features are, by side.
    """

    example: Example
    folds: dict[Hemisphere, Folds]

    @property
    def without_initial(self) -> Example:
        """The example for a system that takes no initial surfaces."""
        return dataclasses.replace(self.example, scan=Scan(self.example.scan.image))

    def distance_at(self, feature: str, side: Hemisphere, found: Mesh) -> float:
        """The mean distance in mm from the true surface of a side to a found one, over the vertices of a feature."""
        target = self.example.targets[side, "white"]
        chosen = self.folds[side].near(feature, _in_frame(target.vertices, side))
        return float(vertex_distances(target, found)[chosen.numpy()].mean())


def miniature(seed: int, n_faces: int = 1500) -> Miniature:
    """A miniature subject with a scan of 1.5 mm. The seed decides where the features are, and the noise.

    The initial surfaces are those of ``meshot_book.tissue.tissue_surface`` for a segmentation without errors,
    except that it contains the bridges, which are as bright as white matter.

    Parameters
    ----------
    seed : int
    n_faces : int
        Approximate number of faces of the initial surfaces.
    """
    draws = numpy_generator(seed)
    affine = np.diag([*_SIZES, 1.0])
    affine[:3, 3] = -_SIZES * (np.array(_SHAPE) - 1) / 2
    grid = Volume(np.zeros(_SHAPE), affine)
    folds, targets, initial = {}, {}, {}
    inside = np.zeros(_SHAPE)
    for side in HEMISPHERES:
        folds[side] = Folds(*draws.uniform(-1.5, 1.5, 3).tolist())
        mesh = folded_ball(folds[side])
        # In the frame of its hemisphere, in its place in the head. A reflection reverses the faces.
        vertices = mesh.vertices * mesh.vertices.new_tensor(_signs(side)) + mesh.vertices.new_tensor(_CENTRES[side])
        target = Mesh(vertices, mesh.faces if side == "left" else mesh.faces.flip(1))
        indices = torch.from_numpy(np.indices(_SHAPE).reshape(3, -1).T.astype(np.float64))
        places = _in_frame(voxel_to_mm(grid, indices), side).numpy()
        scaled = (places - (folds[side].bridged, 0.0, -8.0)) / (2.5, 1.5, 1.2)
        # Nine tenths in an ellipsoid between the banks of the bridged sulcus.
        bridge = 0.9 * (np.linalg.norm(scaled, axis=1) < 1).reshape(_SHAPE)
        bright = np.maximum(enclosed_fractions(target, grid), bridge)
        inside += bright
        targets[side, "white"] = target.to(torch.float32)
        initial[side, "white"] = tissue_surface(grid.with_data(bright), n_faces).mesh.to(torch.float32)
    image = 0.4 + 0.4 * inside + _NOISE * draws.standard_normal(_SHAPE)
    scan = Scan(grid.with_data(np.clip(image, 0, 1).astype(np.float32)), initial)
    return Miniature(Example(f"miniature {seed}", scan, targets), folds)


def _signs(side: Hemisphere) -> tuple[float, float, float]:
    return (1.0, 1.0, 1.0) if side == "left" else (-1.0, 1.0, 1.0)


def _in_frame(places: Float[Tensor, "n 3"], side: Hemisphere) -> Float[Tensor, "n 3"]:
    return (places - places.new_tensor(_CENTRES[side])) * places.new_tensor(_signs(side))
