"""Vox2Cortex: a residual U-Net that segments, and graph networks that move templates to all surfaces at once.

As in the paper: one network for all surfaces; a loss of the segmentation; four stages, each supervised, which move
vertices directly, with no flow; features of encoder and decoder at the vertices, coarse before fine; Chamfer weighted
by curvature, normals, Laplacian, normal consistency and edge length, with the weights of the authors' model. With the
setting ``template.surfaces: [white, pial]``, as in the paper, the same network moves four templates, and white and pial
surfaces exchange what they know; without it, it moves the two white ones.

Ours is smaller: fewer channels and levels, voxels folded in blocks, fewer graph blocks and vertices. In the authors'
model, a vertex reads the positions of the five nearest vertices of the other surface. In ours, it reads position and
features of one: the corresponding vertex of the other surface of its side. The segmentation has white matter only. Ours
normalises instances and vertices in place of batches. All templates are FreeSurfer's average white surfaces, smoothed,
in the mean boxes of the training surfaces, also those that become pial surfaces.

References: Bongratz et al., *Vox2Cortex: fast explicit reconstruction of cortical surfaces from 3D MRI scans with
geometric deep neural networks*, CVPR 2022.
"""

from collections.abc import Mapping
from pathlib import Path

import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey, listed
from meshot.systems.learning import TemplateSettings, completed_groups, scaled_image, surfaces_of_sides
from meshot.systems.parts import Part
from meshot.systems.protocol import SurfaceSystem
from meshot.systems.vox2cortex.losses import MeshWeights
from meshot.systems.vox2cortex.network import MeshNetwork, NetworkSettings
from meshot.systems.vox2cortex.training import MeshSettings, train_meshes
from meshot.train import Groups, Progress

_GROUPS = {"network": NetworkSettings, "template": TemplateSettings, "loss": MeshWeights, "training": MeshSettings}


class System(SurfaceSystem):
    """Vox2Cortex for the surfaces of both sides, with one network.

    Raises
    ------
    ValueError
        If the network moves other surfaces than the settings in its record name.
    """

    name = "vox2cortex"
    networks = {"meshes": MeshNetwork}  # noqa: RUF012 (of the class, by the protocol)

    def __init__(self, parts: Mapping[str, Part]):
        super().__init__(parts)
        for part in parts.values():
            if part.network.surfaces != self.surfaces:
                raise ValueError(
                    f"the weights of {self.name} are for {listed(part.network.surfaces)}, and their settings "
                    f"(template.surfaces) name {listed(self.surfaces)}: take weights of a training with these settings"
                )

    @classmethod
    def surfaces_of(cls, settings: Mapping) -> tuple[SurfaceKey, ...]:
        """Those of ``template.surfaces``, of both sides."""
        return surfaces_of_sides(settings.get("template", {}))

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: the groups ``network``, ``template``, ``loss`` and ``training``."""
        return completed_groups(
            cls.name, settings, _GROUPS, lambda groups: MeshNetwork(**groups["network"], template=groups["template"])
        )

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train the network of all surfaces."""
        place = None if folder is None else folder / "meshes"
        return {"meshes": train_meshes(examples, settings, place, progress, device)}

    @torch.no_grad()
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The templates after the last stage.

        Raises
        ------
        ValueError
            If a vertex is moved to a position that is not finite.
        """
        network, found = self.parts["meshes"].network, {}
        device = next(network.parameters()).device
        maps = network.unet(scaled_image(scan.image).to(device))
        for side in HEMISPHERES:
            template = network.templates[side].mesh().to(device)
            for kind, mesh in network.surfaces_after(maps, scan.image, template, side)[-1].items():
                if not bool(torch.isfinite(mesh.vertices).all()):
                    raise ValueError("vertices are moved to positions that are not finite: is the network trained?")
                found[side, kind] = mesh.to("cpu", torch.float64)
        return found
