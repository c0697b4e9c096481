"""Vox2Cortex: a residual U-Net that segments, and graph networks that move templates to both white surfaces at once.

As in the paper: one network for all surfaces; a loss of the segmentation; four stages, each supervised, which move
vertices directly, with no flow; features of encoder and decoder at the vertices, coarse before fine; Chamfer weighted
by curvature, normals, Laplacian, normal consistency and edge length, with the weights of the authors' model. Ours is
smaller: fewer channels and levels, voxels folded in blocks, fewer graph blocks and vertices. It has white surfaces
only, hence no exchange between white and pial surfaces. It normalises instances and vertices in place of batches.
The templates are FreeSurfer's average white surfaces, smoothed, in the mean boxes of the training surfaces.

References: Bongratz et al., *Vox2Cortex: fast explicit reconstruction of cortical surfaces from 3D MRI scans with
geometric deep neural networks*, CVPR 2022.
"""

from pathlib import Path

import torch

from meshot.mesh import Mesh
from meshot.systems.examples import ExampleSets, Scan, SurfaceKey
from meshot.systems.learning import TemplateSettings, completed_groups, scaled_image
from meshot.systems.protocol import Part, SurfaceSystem
from meshot.systems.vox2cortex.losses import MeshWeights
from meshot.systems.vox2cortex.network import MeshNetwork, NetworkSettings
from meshot.systems.vox2cortex.training import KEYS, MeshSettings, train_meshes
from meshot.train import Groups, Progress

_GROUPS = {"network": NetworkSettings, "template": TemplateSettings, "loss": MeshWeights, "training": MeshSettings}


class System(SurfaceSystem):
    """Vox2Cortex for the white surfaces of both sides, with one network."""

    name = "vox2cortex"
    surfaces = KEYS
    networks = {"meshes": MeshNetwork}  # noqa: RUF012 (of the class, by the protocol)

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
        """Train the network of both sides."""
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
        for key in self.surfaces:
            template = network.templates[key[0]].mesh().to(device)
            mesh = network.move(maps, scan.image, template, key[0])[-1]
            if not bool(torch.isfinite(mesh.vertices).all()):
                raise ValueError("vertices are moved to positions that are not finite: is the network trained?")
            found[key] = mesh.to("cpu", torch.float64)
        return found
