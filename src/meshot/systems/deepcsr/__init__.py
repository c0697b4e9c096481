"""DeepCSR: signed distances at points, from image features at several resolutions; surfaces by marching cubes.

As in the paper: an encoder whose maps at all resolutions, and one global vector, are read at every query point; a
decoder of residual blocks, whose normalisation is modulated by these features; one signed distance for each surface;
training with the absolute error at points near the surfaces and in space; a dense grid, smoothing, the largest
component, a correction of its topology, marching cubes. Ours is smaller: fewer and narrower levels, voxels of the image
folded in blocks, and the grid of the image (or half its spacing) in place of .5 mm. With the setting
``surface.surfaces: [white, pial]``, as in the paper, the network has a distance for each of the four surfaces; without
it, for the two white ones. Our decoder normalises each point alone in place of the batch, and our topology correction
is that of the initial surfaces here.

References: Santa Cruz et al., *DeepCSR: a 3D deep learning approach for cortical surface reconstruction*, WACV 2021.
"""

from collections.abc import Mapping
from pathlib import Path

import torch

from meshot.mesh import Mesh
from meshot.systems.deepcsr.network import DistanceNetwork, NetworkSettings
from meshot.systems.deepcsr.surface import SurfaceSettings, closed_surface, distance_grids
from meshot.systems.deepcsr.training import DistanceSettings, train_distances
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey, listed
from meshot.systems.learning import completed_groups, surfaces_of_sides
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, Progress

_GROUPS = {"network": NetworkSettings, "surface": SurfaceSettings, "training": DistanceSettings}


class System(SurfaceSystem):
    """DeepCSR for the surfaces of both sides, with one network.

    Raises
    ------
    ValueError
        If the network has distances for another number of surfaces than the settings in its record name.
    """

    name = "deepcsr"
    networks = {"distances": DistanceNetwork}  # noqa: RUF012 (of the class, by the protocol)

    def __init__(self, parts: Mapping[str, Part]):
        super().__init__(parts)
        for part in parts.values():
            if part.network.arguments["n_surfaces"] != len(self.surfaces):
                raise ValueError(
                    f"the weights of {self.name} are for {part.network.arguments['n_surfaces']} surfaces, and their "
                    f"settings (surface.surfaces) name {listed(self.surfaces)}: take weights of a training with these "
                    "settings"
                )

    @classmethod
    def surfaces_of(cls, settings: Mapping) -> tuple[SurfaceKey, ...]:
        """Those of ``surface.surfaces``, of both sides."""
        return surfaces_of_sides(settings.get("surface", {}))

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: the groups ``network``, ``surface`` and ``training``."""
        return completed_groups(
            cls.name,
            settings,
            _GROUPS,
            lambda groups: DistanceNetwork(len(cls.surfaces_of(groups)), **groups["network"]),
        )

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train the network of all surfaces."""
        place = None if folder is None else folder / "distances"
        return {"distances": train_distances(cls.surfaces_of(settings), examples, settings, place, progress, device)}

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
