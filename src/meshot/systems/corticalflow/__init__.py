"""CorticalFlow++: a template that three U-Nets carry, one after the other, by stationary velocity grids.

As in the papers: a fixed smooth template; three blocks, each fed with the image and the velocity grids before it; RK4
with 30 steps; blocks trained one after the other, with the earlier ones frozen; Chamfer and edge length; networks for
each side. With the setting ``template.surfaces: [white, pial]``, as in CorticalFlow++, three more blocks of each side
carry the white surface that was found to the pial surface. They are trained after the white ones, which are frozen, and
read the image and the velocity grids of their own cascade. White and pial surfaces so have the same faces. Without the
setting, white surfaces alone are found.

Ours is smaller: the grid has twice the voxel size of the image (if ``network.fold`` is 2), and all blocks have one
width, number of levels and template. Our U-Net has instance normalisation. The template is FreeSurfer's average white
surface, smoothed, in the mean box of the training surfaces. The sample points and steps are fewer than in the papers.

References: Lebrat et al., *CorticalFlow: a diffeomorphic mesh transformer network for cortical surface reconstruction*,
NeurIPS 2021; Santa Cruz et al., *CorticalFlow++: boosting cortical surface reconstruction accuracy, regularity, and
interoperability*, 2022.
"""

from collections.abc import Mapping
from pathlib import Path

import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.systems.corticalflow.blocks import FlowBlock, carried_through
from meshot.systems.corticalflow.settings import ChainSettings, FlowSettings
from meshot.systems.corticalflow.training import train_block
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.systems.learning import TemplateSettings, completed_groups, scaled_image, surfaces_of_sides
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.train import Groups, Progress

N_BLOCKS = 3
_GROUPS = {"network": FlowSettings, "template": TemplateSettings, "training": ChainSettings}


def _names(key: SurfaceKey) -> list[str]:
    """The blocks whose cascade ends at a surface."""
    return [f"{'_'.join(key)}_{k + 1}" for k in range(N_BLOCKS)]


class System(SurfaceSystem):
    """CorticalFlow++: three blocks for each white surface, and three more for each pial one, if the settings say so."""

    name = "corticalflow"
    networks = {  # noqa: RUF012 (of the class, by the protocol)
        name: FlowBlock for side in HEMISPHERES for kind in ("white", "pial") for name in _names((side, kind))
    }

    @classmethod
    def surfaces_of(cls, settings: Mapping) -> tuple[SurfaceKey, ...]:
        """Those of ``template.surfaces``, of both sides."""
        return surfaces_of_sides(settings.get("template", {}))

    @classmethod
    def parts_of(cls, settings: Mapping) -> tuple[str, ...]:
        """The blocks of these surfaces."""
        return tuple(name for key in cls.surfaces_of(settings) for name in _names(key))

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: the groups ``network``, ``template`` and ``training``."""
        return completed_groups(
            cls.name, settings, _GROUPS,
            lambda groups: FlowBlock("left", N_BLOCKS - 1, **groups["network"], template=groups["template"]),
        )  # fmt: skip

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train the blocks of the side in the settings, or of both sides, one after the other; the white ones first."""
        parts: dict[str, Part] = {}
        for side in ChainSettings(**settings["training"]).sides:
            own = settings | {"training": settings["training"] | {"side": side}}
            white: list[FlowBlock] = []
            for key in (key for key in cls.surfaces_of(settings) if key[0] == side):
                earlier: list[FlowBlock] = []
                for name in _names(key):
                    place = None if folder is None else folder / name
                    parts[name] = train_block(earlier, side, examples, own, place, progress, device, white)
                    earlier.append(parts[name].network)
                white = earlier
        for part in parts.values():
            part.network.cpu()
        return parts

    @torch.no_grad()
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The templates carried by the blocks of the white surfaces, and these by the blocks of the pial ones.

        The flows are integrated with the settings of the training.

        Raises
        ------
        ValueError
            If a flow gives positions that are not finite.
        """
        values, found = scaled_image(scan.image), {}
        for key in self.surfaces:
            parts = [self.parts[name] for name in _names(key)]
            blocks = [part.network for part in parts]
            training = {"n_flow_steps": 30, "method": "rk4"} | parts[0].record.get("training", {})
            box = blocks[0].template.box
            start = blocks[0].template.mesh() if key[1] == "white" else found[key[0], "white"]
            flow = (training["n_flow_steps"], training["method"])
            mesh, _ = carried_through(blocks, start.to(box.device, box.dtype), scan.image, values.to(box), *flow)
            if not bool(torch.isfinite(mesh.vertices).all()):
                raise ValueError("the flow leads to vertices that are not finite: are the networks trained?")
            found[key] = mesh.to("cpu", torch.float64)
        return found
