"""The network of Vox2Cortex: a residual U-Net, and graph networks that move the vertices of templates in stages."""

import dataclasses
import itertools
from collections.abc import Mapping

import torch
from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.geometry import mesh_edges
from meshot.model import (
    CLASSES,
    FeatureNetwork,
    GraphConvolution,
    ResidualGraphBlock,
    initialise,
    sample_features,
    unfolded,
)
from meshot.rng import Generator, numpy_generator
from meshot.systems.examples import SurfaceKey
from meshot.systems.learning import Template, TemplateSettings, surfaces_of_sides
from meshot.types import Float, Tensor
from meshot.volume import Volume

N_STAGES = 4


@dataclasses.dataclass(frozen=True)
class NetworkSettings:
    """Architecture: see :class:`meshot.systems.vox2cortex.network.MeshNetwork`."""

    width: int = 8
    depth: int = 4
    fold: int = 2
    n_features: int = 32
    n_blocks: int = 2


class MeshNetwork(nn.Module):
    """From a scan to a segmentation and, in four stages, to the surfaces of both sides.

    Every stage reads features of the U-Net at the vertices, on two levels of the encoder and two of the decoder, passes
    them with its own features, the positions and the side through residual graph blocks, and moves every vertex by a
    graph convolution. Early stages read coarse levels, late stages fine ones.

    With ``surfaces: [white, pial]`` in the settings of the templates, the white and the pial template of a side have
    the same faces, and move together. In every stage, a vertex then also reads the features of the corresponding vertex
    of the other surface, the way to it, and which of both surfaces it is on.

    Parameters
    ----------
    width, depth, fold : int
        Of the U-Net: see :class:`meshot.model.FeatureNetwork`.
    n_features : int
        Features of a vertex.
    n_blocks : int
        Residual graph blocks in a stage.
    template : dict
        The settings of the templates, see :class:`meshot.systems.learning.TemplateSettings`.
    boxes : mapping, optional
        The box of each template, in mm, by its name: "left" and "right" are the white ones; "left_pial", "right_pial".
    generator : generator or int
        Source of the initial weights. Those that move vertices are zero.

    Raises
    ------
    ValueError
        If a count is outside its range.
    """

    def __init__(
        self, width: int = 8, depth: int = 4, fold: int = 2, n_features: int = 32, n_blocks: int = 2,
        template: dict | None = None, boxes: Mapping[str, Tensor] | None = None, generator: Generator = 0,
    ):  # fmt: skip
        super().__init__()
        for name, count, most in (("n_features", n_features, 1024), ("n_blocks", n_blocks, 20)):
            require_positive_integer(count, name, most)
        require_positive_integer(depth - 1, "depth - 1", 9)
        shape, boxes = TemplateSettings(**template or {}), boxes or {}
        self.arguments = {"width": width, "depth": depth, "fold": fold, "n_features": n_features, "n_blocks": n_blocks}
        self.kinds, self.surfaces = (
            shape.surfaces,
            surfaces_of_sides({"surfaces": shape.surfaces}),
        )
        names = {template_name(key): key[0] for key in self.surfaces}
        self.templates = nn.ModuleDict({name: Template(side, shape, boxes.get(name)) for name, side in names.items()})
        self.unet = FeatureNetwork(width, depth, fold, residual=True, generator=generator)
        self.to_classes = nn.Conv3d(width, len(CLASSES) * fold**3, 3, padding=1)
        together = len(self.kinds) > 1
        n_own = 4 + together  # position and side, and the kind
        n_read = n_features + n_own + together * (n_features + 3)
        self.begin = ResidualGraphBlock(n_own, n_features)
        self.stages = nn.ModuleList(
            _Stage(sum(self.unet.widths[level] for level in self.levels(k)) + n_read, n_features, n_blocks)
            for k in range(N_STAGES)
        )
        generator = numpy_generator(generator)
        for part in (self.to_classes, self.begin, self.stages):
            initialise(part, generator)
        with torch.no_grad():
            for stage in self.stages:
                for layer in (stage.move.own, stage.move.others):
                    layer.weight.zero_()

    def levels(self, stage: int) -> tuple[int, ...]:
        """The maps of the U-Net that a stage reads: of the encoder from coarse to fine, and of the decoder."""
        depth = self.arguments["depth"]
        n_maps, coarse = len(self.unet.widths), depth - 1
        first = max(coarse - 1 - round(stage * (coarse - 1) / (N_STAGES - 1)), 0)
        return tuple(sorted({first, first + 1, n_maps - 2 - first, n_maps - 1 - first}))

    def config(self) -> dict:
        """The arguments that create a network of the same architecture."""
        return self.arguments | {"template": dataclasses.asdict(self.templates["left"].settings)}

    def segmentation(self, maps: list[Tensor]) -> Float[Tensor, "1 3 x y z"]:
        """Logits of background, left and right white matter on the grid of the image."""
        return unfolded(self.to_classes(maps[-1]), self.arguments["fold"])

    def move(self, maps: list[Tensor], image: Volume, mesh: Mesh, side: Hemisphere) -> list[Mesh]:
        """The white surface of one side after each of the four stages: see :meth:`surfaces_after`."""
        return [found["white"] for found in self.surfaces_after(maps, image, mesh, side)]

    def surfaces_after(self, maps: list[Tensor], image: Volume, mesh: Mesh, side: Hemisphere) -> list[dict[str, Mesh]]:
        """The surfaces of one side after each of the four stages, by kind.

        Parameters
        ----------
        maps : list of tensor
            The maps of the U-Net.
        image : Volume
            The scan, whose affine places the maps.
        mesh : Mesh
            The white template of the side, in mm; any number of faces. The pial surface begins as the same mesh in the
            box of the pial template.
        side : str
        """
        n, box, found = len(mesh.vertices), self.templates[side].box, []
        edges, numbers = mesh_edges(mesh), self._numbers(mesh, side)
        edges = torch.cat([edges + k * n for k in range(len(self.kinds))])
        extent = (box[1] - box[0]).max() / 2

        def own(vertices: Tensor) -> Tensor:
            return torch.cat([2 * (vertices - box[0]) / (box[1] - box[0]) - 1, numbers], dim=1)

        vertices = self._starts(mesh, side)
        features = self.begin(own(vertices), edges)
        for k, stage in enumerate(self.stages):
            sampled = sample_features([maps[level] for level in self.levels(k)], image, vertices)
            read = [features, sampled, own(vertices)]
            if len(self.kinds) > 1:  # of all vertices, the corresponding one is half of them away
                read += [features.roll(n, 0), (vertices.roll(n, 0) - vertices) / extent]
            features = stage(torch.cat(read, dim=1), edges)
            vertices = vertices + extent * stage.move(features, edges)
            # One part is not split: that would change the order in which gradients are added, and their last bits.
            parts = vertices.split(n) if len(self.kinds) > 1 else [vertices]
            found.append({kind: mesh.with_vertices(part) for kind, part in zip(self.kinds, parts)})
        return found

    def _starts(self, mesh: Mesh, side: Hemisphere) -> Float[Tensor, "v 3"]:
        """The vertices of a white template, and then the same in the box of the pial template."""
        (low, high), found = self.templates[side].box, [mesh.vertices]
        for kind in self.kinds[1:]:
            lower, upper = self.templates[template_name((side, kind))].box
            found.append(lower + (mesh.vertices - low) / (high - low) * (upper - lower))
        return torch.cat(found)

    def _numbers(self, mesh: Mesh, side: Hemisphere) -> Float[Tensor, "v _"]:
        """The side of every vertex as a number, and its kind if there is more than one."""
        found = [
            mesh.vertices.new_tensor([HEMISPHERES.index(side), k]).expand(len(mesh.vertices), 2)
            for k in range(len(self.kinds))
        ]
        return torch.cat(found)[:, : len(self.kinds)]


def template_name(key: SurfaceKey) -> str:
    """The name of the template of a surface: the side of a white one, and such as ``left_pial`` for a pial one."""
    side, kind = key
    return side if kind == "white" else f"{side}_{kind}"


class _Stage(nn.Module):
    def __init__(self, n_in: int, n_features: int, n_blocks: int):
        super().__init__()
        widths = [n_in] + [n_features] * n_blocks
        self.blocks = nn.ModuleList(ResidualGraphBlock(*pair) for pair in itertools.pairwise(widths))
        self.move = GraphConvolution(n_features, 3)

    def forward(self, features: Tensor, edges: Tensor) -> Tensor:
        for block in self.blocks:
            features = block(features, edges)
        return features
