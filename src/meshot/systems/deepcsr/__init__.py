"""DeepCSR: signed distances at points, from image features at several resolutions; surfaces by marching cubes.

As in the paper: an encoder whose maps at all resolutions, and one global vector, are read at every query point; a
decoder of residual blocks, whose normalisation is modulated by these features; one signed distance for each surface;
training with the absolute error at points near the surfaces and in space; a dense grid, smoothing, the largest
component, a correction of its topology, marching cubes. Ours is smaller: fewer and narrower levels, voxels of the image
folded in blocks, the grid of the image (or half its spacing) in place of .5 mm, and white surfaces only. Our decoder
normalises each point alone in place of the batch, and our topology correction is that of the initial surfaces here.

References: Santa Cruz et al., *DeepCSR: a 3D deep learning approach for cortical surface reconstruction*, WACV 2021.
"""

from pathlib import Path

import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.systems.deepcsr.network import DistanceNetwork, NetworkSettings
from meshot.systems.deepcsr.surface import SurfaceSettings, closed_surface, distance_grids
from meshot.systems.deepcsr.training import DistanceSettings, train_distances
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.systems.learning import completed_groups
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, Progress

_GROUPS = {"network": NetworkSettings, "surface": SurfaceSettings, "training": DistanceSettings}


class System(SurfaceSystem):
    """DeepCSR for the white surfaces of both sides, with one network."""

    name = "deepcsr"
    surfaces = tuple((side, "white") for side in HEMISPHERES)
    networks = {"distances": DistanceNetwork}  # noqa: RUF012 (of the class, by the protocol)

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: the groups ``network``, ``surface`` and ``training``."""
        return completed_groups(
            cls.name, settings, _GROUPS, lambda groups: DistanceNetwork(len(cls.surfaces), **groups["network"])
        )

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train the network of all surfaces."""
        place = None if folder is None else folder / "distances"
        return {"distances": train_distances(cls.surfaces, examples, settings, place, progress, device)}

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The zero level sets of the predicted distances, after a correction of their topology.

        Raises
        ------
        ValueError
            If the network finds no inside of a surface.
        """
        part = self.parts["distances"]
        settings = SurfaceSettings(**part.record.get("surface", {}))
        grids = distance_grids(part.network, scan.image, settings.splits)
        return {key: closed_surface(grid, " ".join(key), settings) for key, grid in zip(self.surfaces, grids)}
