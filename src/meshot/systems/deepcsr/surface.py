"""From predicted distances to closed surfaces: a dense grid, smoothing, topology, marching cubes."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import taubin_smoothing
from meshot.systems.deepcsr.network import DistanceNetwork
from meshot.systems.learning import SURFACES, checked_surfaces, scaled_image
from meshot.types import Array, Float, Int64
from meshot.volume import Volume, cropped, voxel_sizes, voxel_to_mm
from meshot.volume.surfaces import filled_cavities, genus_zero, isosurface, largest_component, separated_field

_CHUNK = 1 << 16
_BAND = 1.5  # in steps of the coarse grid: nearer to a surface, every voxel is evaluated
_MARGIN_VOXELS = 0.05


@dataclasses.dataclass(frozen=True)
class SurfaceSettings:
    """From distances to surfaces.

    Parameters
    ----------
    splits : int
        Into how many parts the spacing of the image is divided along each axis.
    blur : float
        Standard deviation of the Gaussian that smooths the distances, in voxels of the grid.
    smoothing : int
        Number of steps of Taubin smoothing of the surface.
    surfaces : sequence of str
        The surfaces of each side that are found: [white], or [white, pial].

    Raises
    ------
    ValueError
        If a number is outside its range, or the surfaces are unknown.
    """

    splits: int = 1
    blur: float = 0.5
    smoothing: int = 5
    surfaces: Sequence[str] = SURFACES[0]

    def __post_init__(self):
        object.__setattr__(self, "surfaces", checked_surfaces(self.surfaces))
        require_positive_integer(self.splits, "splits", 4)
        require_positive_integer(self.smoothing + 1, "smoothing + 1", 1000)
        if not 0 <= self.blur < math.inf:
            raise ValueError(f"blur is {self.blur!r}; a number >= 0 is needed, in voxels")


@torch.no_grad()
def distance_grids(network: DistanceNetwork, image: Volume, splits: int = 1, every: int = 2) -> list[Volume]:
    """The predicted distances (mm, negative inside) on a grid over the image, one volume for each surface.

    The network is evaluated in every second voxel along each axis. Where it then expects a surface within three voxels,
    it is evaluated in every voxel. Elsewhere the distances are interpolated.

    Parameters
    ----------
    network : DistanceNetwork
    image : Volume
    splits : int
        See :class:`SurfaceSettings`.
    every : int
        In place of 2. With 1, the network is evaluated in every voxel.
    """
    affine = image.affine.copy()
    affine[:3, :3] /= splits
    affine[:3, 3] += affine[:3, :3] @ np.full(3, (1 - splits) / 2)
    grid = Volume(np.zeros(np.array(image.data.shape) * splits, dtype=np.float32), affine)
    parameter = next(network.parameters())
    maps, whole = network.encode(scaled_image(image).to(parameter))

    def evaluated(voxels: Int64[Array, "n 3"]) -> Float[Array, "n s"]:
        parts = voxel_to_mm(grid, torch.from_numpy(voxels.astype(np.float32))).split(_CHUNK)
        return torch.cat([network(maps, whole, image, part.to(parameter)).cpu() for part in parts]).numpy()

    shape = grid.data.shape
    coarse = np.stack(np.meshgrid(*(np.arange(0, n, every) for n in shape), indexing="ij"), axis=-1)
    values = evaluated(coarse.reshape(-1, 3)).reshape(*coarse.shape[:3], -1)
    places = np.indices(shape) / every
    found = np.stack(
        [scipy.ndimage.map_coordinates(each, places, order=1, mode="nearest") for each in np.moveaxis(values, -1, 0)]
    )
    if every > 1:
        near = (np.abs(found) < _BAND * every * voxel_sizes(grid).max()).any(axis=0)
        if near.any():
            found[:, near] = evaluated(np.argwhere(near)).T
    return [grid.with_data(each) for each in found]


def closed_surface(distance: Volume, name: str, settings: SurfaceSettings) -> Mesh:
    """The zero level set of a distance, with the topology of a sphere.

    Steps: smoothing, the largest component of the inside, filled cavities, genus-0 correction by depth, marching cubes,
    light smoothing.

    Parameters
    ----------
    distance : Volume
        In mm, negative inside.
    name : str
        Of the surface, for the message.
    settings : SurfaceSettings

    Raises
    ------
    ValueError
        If the distance is nowhere negative.
    """
    smooth = scipy.ndimage.gaussian_filter(distance.data, settings.blur) if settings.blur else distance.data
    depth = distance.with_data(-smooth)
    if not (depth.data > 0).any():
        raise ValueError(f"the network finds no inside of the surface {name}: is it trained, and is the scan a T1?")
    places = np.argwhere(largest_component(depth.data > 0))
    box = cropped(depth, voxel_to_mm(depth, torch.from_numpy(places).double()))
    mask = filled_cavities(largest_component(box.data > 0))
    ball = genus_zero(mask, box.data)
    margin = _MARGIN_VOXELS * float(voxel_sizes(box).min())
    return taubin_smoothing(isosurface(separated_field(box, ball, 0.0, margin), 0.0), settings.smoothing)
