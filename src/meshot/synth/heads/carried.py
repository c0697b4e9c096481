"""Tissue of the average carried to a subject, by the inverse of the deformation that made its cortex."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.anatomy import MNI305_TO_MNI152
from meshot.synth.heads.leaves import Leaves, leaf_fractions
from meshot.synth.heads.template import TemplateTissue, template_tissue
from meshot.synth.structures import DEPTH_MM, white_depth
from meshot.synth.warp import HeadWarp
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume, mm_to_voxel, transform_points, voxel_sizes, voxel_to_mm

_COARSE = 4  # the deformation is computed at every fourth voxel along each axis, and interpolated between
_GROWTH_MM = 6.0  # by which the border of the ventricles moves outwards when their size doubles
_SPARSE = 50  # every n-th voxel of the hindbrain shows where it ends, to about a voxel
_LEAST = 0.05  # fraction of grey matter from which on a voxel of the cerebellum is divided
_BRAINSTEM = (18.0, -44.0)  # mm of MNI152: within this distance of the midline and in front of it there are no leaves
Places = Float[Array, "X Y Z 3"]
Field = Float[Array, "X Y Z"]


@dataclasses.dataclass(frozen=True, eq=False)
class CarriedHead:
    """The inside of MNI152 in a subject's head, see ``meshot.synth.imaging.Interior``.

    Parameters
    ----------
    warp : HeadWarp
        The deformation that made the subject's cortex from fsaverage5.
    motion : array
        The rigid motion from head coordinates to scanner RAS.
    ventricles : float
        The size of the lateral ventricles, relative to those of the average; 0 for none.
    leaves : Leaves, optional
        Sizes of the leaves of the cerebellum. None for the smooth cerebellum of the average.
    seed : int or sequence of int
        Source of the leaves.
    """

    warp: HeadWarp
    motion: Float[Array, "4 4"]
    ventricles: float = 1.0
    leaves: Leaves | None = None
    seed: int | Sequence[int] = 0

    def ends(self) -> Float[Tensor, "n 3"]:
        """Points of the hindbrain, in scanner RAS."""
        region = template_tissue().hindbrain
        points = voxel_to_mm(region, torch.from_numpy(np.argwhere(region.data > 0.5)[::_SPARSE].astype(np.float64)))
        heads = transform_points(np.linalg.inv(MNI305_TO_MNI152), points)
        return transform_points(self.motion, self.warp.forward(heads))

    def added_to(
        self, fractions: Mapping[str, Float[Array, "X Y Z"]], inside_pial: Float[Array, "X Y Z"], grid: Volume
    ) -> dict[str, Float[Array, "X Y Z"]]:
        """Tissue fractions in which the inside of the average replaces white matter, or lies outside the pial surfaces.

        Structures inside keep a distance of ``DEPTH_MM`` to the white surfaces, which are therefore always a border
        between white matter and cortex.
        """
        tissue, places = template_tissue(), self._template_places(grid)
        deep, fluid = self._inner(tissue, places)
        room = np.clip(0.5 + (white_depth(fractions["white"], voxel_sizes(grid)) - DEPTH_MM), 0, 1)
        inner = {"deep grey": deep * room, "fluid": fluid * room}
        outer = self._hindbrain(tissue, places, float(voxel_sizes(grid).mean()))
        outer = {name: part * (1 - inside_pial) for name, part in outer.items()}
        left = 1 - sum(inner.values())
        found = {"white": fractions["white"] * left, "grey": fractions["grey"] * left}
        found |= {"deep grey": inner["deep grey"], "hindbrain": np.zeros_like(left)}
        return found | outer | {"fluid": inner["fluid"] + outer["fluid"]}

    def _inner(self, tissue: TemplateTissue, places: Places) -> tuple[Field, Field]:
        """Deep grey matter and ventricles."""
        if not self.ventricles > 0:
            return np.clip(_sampled(tissue.deep_grey, places), 0, 1), np.zeros(places.shape[:-1])
        border = _sampled(tissue.ventricles, places, outside=-99.0) + _GROWTH_MM * (self.ventricles - 1)
        fluid = np.clip(0.5 + border, 0, 1)
        return np.clip(_sampled(tissue.deep_grey, places), 0, 1) * (1 - fluid), fluid

    def _hindbrain(self, tissue: TemplateTissue, places: Places, voxel_mm: float) -> dict[str, Field]:
        """White matter, grey matter and fluid of cerebellum and brainstem."""
        parts = (tissue.hindbrain, tissue.hindbrain_white, tissue.hindbrain_grey)
        inside, white, grey = (_sampled(part, places) for part in parts)
        if self.leaves is not None:
            width, front = _BRAINSTEM
            chosen = (grey > _LEAST) & ~((np.abs(places[..., 0]) < width) & (places[..., 1] > front))
            depths = _sampled(tissue.hindbrain_depth, places)[chosen]
            random = np.random.default_rng(self.seed)
            fluid, core = leaf_fractions(places[chosen], depths, self.leaves, voxel_mm, random)
            white[chosen] += core * grey[chosen]
            grey[chosen] *= 1 - core - fluid
        return {"hindbrain white": white, "hindbrain grey": grey, "fluid": inside - white - grey}

    def _template_places(self, grid: Volume) -> Places:
        """The position in MNI152 of every voxel, in mm."""
        shape = np.array(grid.data.shape)
        coarse = -(-(shape - 1) // _COARSE) + 1
        knots = np.stack(np.meshgrid(*(np.arange(n) * _COARSE for n in coarse), indexing="ij"), axis=-1)
        scanner = voxel_to_mm(grid, torch.from_numpy(knots.reshape(-1, 3).astype(np.float64)))
        heads = self.warp.backward(transform_points(np.linalg.inv(self.motion), scanner))
        found = transform_points(MNI305_TO_MNI152, heads).numpy().reshape(*coarse, 3)
        at = np.stack(np.meshgrid(*(np.arange(n) / _COARSE for n in shape), indexing="ij"))
        return np.stack([scipy.ndimage.map_coordinates(found[..., k], at, order=1) for k in range(3)], axis=-1)


def _sampled(volume: Volume, places: Places, outside: float = 0.0) -> Field:
    at = mm_to_voxel(volume, torch.from_numpy(places.reshape(-1, 3))).numpy().T
    values = scipy.ndimage.map_coordinates(volume.data, at, order=1, cval=outside, prefilter=False)
    return values.reshape(places.shape[:-1]).astype(np.float64)
