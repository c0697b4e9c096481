"""CorticalFlow++: a template that three U-Nets carry, one after the other, by stationary velocity grids.

As in the papers: a fixed smooth template; three blocks, each fed with the image and the velocity grids before it; RK4
with 30 steps; blocks trained one after the other, with the earlier ones frozen; Chamfer and edge length; networks for
each side. Ours is smaller: the grid has twice the voxel size of the image, all blocks have one width and one template,
and only white surfaces are found. Our U-Net has instance normalisation. The template is FreeSurfer's average white
surface, smoothed, in the mean box of the training surfaces. The sample points and steps are fewer than in the papers.

References: Lebrat et al., *CorticalFlow: a diffeomorphic mesh transformer network for cortical surface reconstruction*,
NeurIPS 2021; Santa Cruz et al., *CorticalFlow++: boosting cortical surface reconstruction accuracy, regularity, and
interoperability*, 2022.
"""

from pathlib import Path

import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.systems.corticalflow.blocks import FlowBlock, carried_through
from meshot.systems.corticalflow.settings import ChainSettings, FlowSettings
from meshot.systems.corticalflow.training import train_block
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.systems.learning import TemplateSettings, completed_groups, scaled_image
from meshot.systems.protocol import Part, SurfaceSystem
from meshot.train import Groups, Progress

N_BLOCKS = 3
_GROUPS = {"network": FlowSettings, "template": TemplateSettings, "training": ChainSettings}
_KEYS = tuple((side, "white") for side in HEMISPHERES)


class System(SurfaceSystem):
    """CorticalFlow++ for white surfaces: three blocks for each side."""

    name = "corticalflow"
    surfaces = _KEYS
    networks = {f"{side}_white_{k + 1}": FlowBlock for side in HEMISPHERES for k in range(N_BLOCKS)}  # noqa: RUF012

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
        """Train the blocks of the side in the settings, or of both sides, one after the other."""
        parts = {}
        for side in ChainSettings(**settings["training"]).sides:
            own = settings | {"training": settings["training"] | {"side": side}}
            earlier: list[FlowBlock] = []
            for k in range(N_BLOCKS):
                name = f"{side}_white_{k + 1}"
                place = None if folder is None else folder / name
                parts[name] = train_block(earlier, side, examples, own, place, progress, device)
                earlier.append(parts[name].network)
            for block in earlier:
                block.cpu()
        return parts

    @torch.no_grad()
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The templates carried by all blocks, integrated with the settings of the training.

        Raises
        ------
        ValueError
            If a flow gives positions that are not finite.
        """
        values, found = scaled_image(scan.image), {}
        for side, kind in self.surfaces:
            parts = [self.parts[f"{side}_{kind}_{k + 1}"] for k in range(N_BLOCKS)]
            blocks = [part.network for part in parts]
            training = {"n_flow_steps": 30, "method": "rk4"} | parts[0].record.get("training", {})
            start = blocks[0].template.mesh().to(blocks[0].template.box.device)
            values = values.to(start.vertices)
            flow = (training["n_flow_steps"], training["method"])
            mesh, _ = carried_through(blocks, start, scan.image, values, *flow)
            if not bool(torch.isfinite(mesh.vertices).all()):
                raise ValueError("the flow leads to vertices that are not finite: are the networks trained?")
            found[side, kind] = mesh.to("cpu", torch.float64)
        return found
