"""From the whiteness of a scan to a closed surface: threshold, genus 0, marching cubes, a move to the steepest edge."""

import dataclasses

import numpy as np
import scipy.ndimage
import torch

from meshot.errors import require_positive, require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import taubin_smoothing
from meshot.mesh.geometry import vertex_normals
from meshot.types import Array, Bool
from meshot.volume import Volume, cropped, sample_volume, voxel_to_mm
from meshot.volume.surfaces import filled_cavities, genus_zero, isosurface, largest_component, separated_field

_MARGIN = 0.02  # of whiteness
_DEPTH_WEIGHT = 0.02  # of whiteness, per voxel
_INNERMOST = 0.15  # smallest change of the whiteness over the reach that counts as an edge


@dataclasses.dataclass(frozen=True)
class SurfaceSettings:
    """Regions, bias correction and deformation.

    Parameters
    ----------
    reduction : int
        See :class:`meshot.systems.classical.atlas.Atlas`.
    margin : float
        In mm: how far white matter may lie from where it was in some training subject.
    bias_width : float
        In mm: the standard deviation of the Gaussian of the bias correction.
    bias_rounds, smoothing, rounds : int
        Rounds of the bias correction; steps of Taubin smoothing of the first surface; rounds of the deformation.
    reach, rate : float
        In every round, a vertex looks for the steepest decrease of intensity up to ``reach`` mm along its normal, and
        moves ``rate`` of the way.
    tolerance : float
        Of the whiteness at an edge: an edge counts less the more its whiteness differs from the threshold, by a
        Gaussian of this standard deviation. Otherwise the outer border of a thin cortex would be taken for the inner.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    reduction: int = 4
    margin: float = 4.0
    bias_width: float = 20.0
    bias_rounds: int = 2
    smoothing: int = 5
    rounds: int = 10
    reach: float = 1.5
    rate: float = 0.3
    tolerance: float = 0.1

    def __post_init__(self):
        for name in ("bias_rounds", "smoothing", "rounds"):
            require_positive_integer(getattr(self, name) + 1, f"{name} + 1", 1000)
        for name in ("margin", "bias_width", "reach"):
            require_positive(getattr(self, name), name, "mm")
        require_positive(self.tolerance, "tolerance")
        if not 0 <= self.rate <= 1:
            raise ValueError(f"rate is {self.rate!r}; a share in [0, 1] is needed")


def thresholded_surface(
    white: Volume, level: float, allowed: Bool[Array, "x y z"], deep: Bool[Array, "x y z"], name: str
) -> Mesh:
    """The closed surface where the whiteness takes a level, within a region, with the topology of a sphere.

    Parameters
    ----------
    white : Volume
    level : float
    allowed, deep : array
        Boolean: where the inside may lie, and what belongs to it whatever its intensity.
    name : str
        Of the surface, for the message.

    Raises
    ------
    ValueError
        If no voxel of the region is above the level.
    """
    inside = (white.data > level) & allowed | deep
    if not inside.any():
        raise ValueError(f"no voxel is as bright as white matter for the surface {name}; is the scan a T1?")
    mask = largest_component(inside)
    places = voxel_to_mm(white, torch.from_numpy(np.argwhere(mask)).double())
    filled = white.with_data(np.where(deep, np.maximum(white.data, 1.0), white.data))
    field, box = cropped(filled, places), cropped(white.with_data(mask), places)
    solid = filled_cavities(box.data)
    # Among equally white voxels, depth decides. Otherwise fronts would meet inside white matter and leave wide cuts.
    depth = scipy.ndimage.distance_transform_edt(solid)
    ball = genus_zero(solid, np.minimum(field.data, 1.0) + _DEPTH_WEIGHT * depth)
    # Far from the level the values do not matter, except to the positions at the borders of the region.
    clipped = field.with_data(np.clip(field.data, level - 0.5, level + 0.5))
    return isosurface(separated_field(clipped, ball, level, _MARGIN), level)


def moved_to_edges(mesh: Mesh, white: Volume, level: float, settings: SurfaceSettings, n_offsets: int = 13) -> Mesh:
    """The surface after rounds of a move to the steepest outward decrease of intensity, each with light smoothing.

    Vertices that see no edge within their reach only take part in the smoothing.

    Parameters
    ----------
    mesh : Mesh
    white : Volume
    level : float
        The whiteness that is expected at the edge.
    settings : SurfaceSettings
    n_offsets : int
        Number of positions along the normal, at least 3.
    """
    offsets = torch.linspace(-settings.reach, settings.reach, n_offsets, dtype=torch.float64)
    between = (offsets[1:] + offsets[:-1]) / 2
    for _ in range(settings.rounds):
        normals = vertex_normals(mesh)
        places = mesh.vertices[:, None] + offsets[:, None] * normals[:, None]
        profile = sample_volume(white, places.reshape(-1, 3)).reshape(-1, n_offsets)
        falls, middles = profile[:, :-1] - profile[:, 1:], (profile[:, :-1] + profile[:, 1:]) / 2
        # Of two equal edges the nearer one counts, and the one whose whiteness is nearer to the expected one.
        unlikely = (between / settings.reach) ** 2 + ((middles - level) / settings.tolerance) ** 2
        steepest = (falls * torch.exp(-unlikely / 2)).argmax(dim=1)
        seen = profile.amax(dim=1) - profile.amin(dim=1) > _INNERMOST
        move = torch.where(seen, between[steepest], 0.0) * settings.rate
        mesh = taubin_smoothing(mesh.with_vertices(mesh.vertices + move[:, None] * normals), 1)
    return mesh
