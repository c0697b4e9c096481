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

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Annotated

import numpy as np
import torch
from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.loss import laplacian_length, nearest_neighbours, normal_inconsistency, squared_edge_length
from meshot.mesh import Mesh, face_normals, mean_curvatures, mesh_edges, sample_locations, simplified
from meshot.metrics import Surface
from meshot.model import (
    CLASSES,
    FeatureNetwork,
    GraphConvolution,
    ResidualGraphBlock,
    initialise,
    sample_features,
    segmentation_loss,
    unfolded,
)
from meshot.rng import Generator, numpy_generator
from meshot.settings import Count, Length, NotNegative, Settings, Within
from meshot.systems.learning import (
    LearningSettings,
    Template,
    TemplateSettings,
    mean_box,
    mean_distances,
    of_both_sides,
    scaled_image,
    train_part,
)
from meshot.systems.protocol import Example, ExampleSets, Part, Run, Scan, SurfaceKey, SurfaceSystem, listed
from meshot.types import Float, Tensor
from meshot.volume import Volume, enclosed_fractions

# The network of Vox2Cortex: a residual U-Net, and graph networks that move the vertices of templates in stages.

N_STAGES = 4


@dataclasses.dataclass(frozen=True)
class NetworkSettings(Settings):
    """Architecture: see :class:`meshot.systems.vox2cortex.MeshNetwork`."""

    width: Count = 8
    depth: Annotated[int, Within(2, 10)] = 4
    fold: Count = 2
    n_features: Annotated[int, Within(1, 1024)] = 32
    n_blocks: Annotated[int, Within(1, 20)] = 2


class MeshNetwork(nn.Module):
    """From a scan to a segmentation and, in four stages, to the surfaces of both sides."""

    # Every stage reads features of the U-Net at the vertices, on two levels of the encoder and two of the decoder,
    # passes them with its own features, the positions and the side through residual graph blocks, and moves every
    # vertex by a graph convolution. Early stages read coarse levels, late stages fine ones.
    # With ``surfaces: [white, pial]`` in the settings of the templates, the white and the pial template of a side have
    # the same faces, and move together. In every stage, a vertex then also reads the features of the corresponding
    # vertex of the other surface, the way to it, and which of both surfaces it is on.
    # ``width``, ``depth``, ``fold``: of the U-Net: see :class:`meshot.model.FeatureNetwork`.
    # ``n_features``: features of a vertex.
    # ``n_blocks``: residual graph blocks in a stage.
    # ``boxes``: the box of each template, in mm, by its name: "left" and "right" are the white ones; "left_pial",
    # "right_pial".
    # ``generator``: source of the initial weights. Those that move vertices are zero.

    def __init__(
        self,
        width: int = 8,
        depth: int = 4,
        fold: int = 2,
        n_features: int = 32,
        n_blocks: int = 2,
        template: Mapping | TemplateSettings | None = None,
        boxes: Mapping[str, Tensor] | None = None,
        generator: Generator = 0,
    ):
        super().__init__()
        self.arguments = NetworkSettings(width, depth, fold, n_features, n_blocks).as_dict()
        shape, boxes = TemplateSettings.read(template or {}), boxes or {}
        self.kinds, self.surfaces = shape.surfaces, of_both_sides(shape.surfaces)
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
        """The surfaces of one side after each of the four stages, by kind."""
        n, box, found = len(mesh.vertices), self.templates[side].box, []
        # The side of every vertex as a number, and its kind if there is more than one.
        pairs = [mesh.vertices.new_tensor([HEMISPHERES.index(side), k]).expand(n, 2) for k in range(len(self.kinds))]
        numbers = torch.cat(pairs)[:, : len(self.kinds)]
        edges = mesh_edges(mesh)
        edges = torch.cat([edges + k * n for k in range(len(self.kinds))])
        extent = (box[1] - box[0]).max() / 2

        def own(vertices: Tensor) -> Tensor:
            return torch.cat([2 * (vertices - box[0]) / (box[1] - box[0]) - 1, numbers], dim=1)

        # The vertices of a white template, and then the same in the box of the pial template.
        starts = [mesh.vertices]
        for kind in self.kinds[1:]:
            lower, upper = self.templates[template_name((side, kind))].box
            starts.append(lower + (mesh.vertices - box[0]) / (box[1] - box[0]) * (upper - lower))
        vertices = torch.cat(starts)
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


# The losses of Vox2Cortex on a predicted mesh: Chamfer weighted by curvature, normals, and regularisers.


@dataclasses.dataclass(frozen=True, eq=False)
class CurvedTarget:
    """A true surface with the unsigned mean curvature of its vertices (1/mm)."""

    mesh: Mesh
    curvatures: Float[Tensor, " v"]


def curved_target(mesh: Mesh) -> CurvedTarget:
    """A true surface in float32 with its curvatures."""
    mesh = mesh.to(torch.float32)
    return CurvedTarget(mesh, mean_curvatures(mesh).detach())


def chamfer_and_normals(
    found: Mesh, target: CurvedTarget, n_points: int, most: float, generator: np.random.Generator
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """The Chamfer distance weighted by curvature (mm²), and the mean of 1 − |cosine| between the normals of its pairs.

    Every pair of nearest neighbours has the weight min(1 + κ, ``most``), where κ is the curvature of the target at its
    point of the pair. Both directions are means, and are added.
    """
    points, normals, _ = _sampled(found, n_points, generator)
    truths, true_normals, corners = _sampled(target.mesh, n_points, generator)
    cells, barycentric = corners
    curvatures = (target.curvatures[target.mesh.faces[cells]] * barycentric).sum(dim=1)
    weights = (1 + curvatures).clamp(max=most)
    there, back = nearest_neighbours(points, truths), nearest_neighbours(truths, points)
    forward = (weights[there] * (points - truths[there]).square().sum(dim=1)).mean()
    backward = (weights * (truths - points[back]).square().sum(dim=1)).mean()
    cosines = (normals * true_normals[there]).sum(dim=1), (true_normals * normals[back]).sum(dim=1)
    return forward + backward, sum(1 - each.abs().mean() for each in cosines)


def _sampled(mesh: Mesh, n_points: int, generator: np.random.Generator) -> tuple[Tensor, Tensor, tuple[Tensor, Tensor]]:
    cells, barycentric = sample_locations(mesh, n_points, generator)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[cells]]).sum(dim=1)
    return points, face_normals(mesh)[cells], (cells, barycentric)


#: The factors by which the authors weigh terms of pial surfaces more than those of white ones.
PIAL = {"normals": 1.25, "laplacian": 2.5, "consistency": 2.25}


@dataclasses.dataclass(frozen=True)
class MeshWeights(Settings):
    """Weights of the terms of the loss on meshes, for lengths in units of ``extent`` mm, as in the paper."""

    # They are those of white surfaces. Those of pial surfaces follow from them, see :meth:`of`.

    # chamfer, normals, laplacian, consistency, edge: of the weighted Chamfer distance, the normals of its pairs, the
    # length of the uniform Laplacian, the normals of neighbouring faces, and the mean squared edge length
    chamfer: NotNegative = 1.0
    normals: NotNegative = 0.01
    laplacian: NotNegative = 0.1
    consistency: NotNegative = 0.001
    edge: NotNegative = 5.0
    most_curvature: NotNegative = 5.0  # the largest weight of a pair in the Chamfer distance
    extent: Length = 104.0  # in mm: half the longest side of the image in the paper
    segmentation: NotNegative = 1.0  # of the loss of the segmentation

    def of(self, kind: str) -> "MeshWeights":
        """The weights for a kind of surface, "white" or "pial"."""
        more = PIAL if kind == "pial" else {}
        return dataclasses.replace(self, **{name: factor * getattr(self, name) for name, factor in more.items()})

    def mesh_loss(
        self, found: Mesh, target: CurvedTarget, n_points: int, generator: np.random.Generator
    ) -> Float[Tensor, ""]:
        """The weighted sum of all terms for one mesh."""
        chamfer, normals = chamfer_and_normals(found, target, n_points, self.most_curvature, generator)
        return (
            (self.chamfer * chamfer + self.edge * squared_edge_length(found)) / self.extent**2
            + self.laplacian * laplacian_length(found) / self.extent
            + self.normals * normals
            + self.consistency * normal_inconsistency(found)
        )


# Training of Vox2Cortex: segmentation and the meshes of all four stages, of all surfaces at once.


@dataclasses.dataclass(frozen=True)
class MeshSettings(LearningSettings):
    """Settings of the training: those of all trainings, and the following."""

    n_faces: Count = 20_480  # number of faces of the templates in training
    n_samples: Count = 10_000  # number of points on each surface for the Chamfer distance


@dataclasses.dataclass(frozen=True)
class MeshGroups(Settings):
    """All settings."""

    network: NetworkSettings
    template: TemplateSettings
    loss: MeshWeights
    training: MeshSettings


def coarse_template(network: MeshNetwork, side: Hemisphere, n_faces: int) -> Mesh:
    """The white template of one side with fewer faces, in float32."""
    return simplified(network.templates[side].mesh(), n_faces).to(torch.float32)


def true_fractions(example: Example) -> Float[Tensor, "1 2 x y z"]:
    """The fractions of every voxel that the true white surfaces of left and right enclose, in float32."""
    found = [enclosed_fractions(example.targets[side, "white"], example.scan.image) for side in HEMISPHERES]
    return torch.from_numpy(np.stack(found).astype(np.float32))[None]


class System(SurfaceSystem):
    """Vox2Cortex for the surfaces of both sides, with one network."""

    name = "vox2cortex"
    groups = MeshGroups
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
    def surfaces_of(cls, settings: MeshGroups) -> tuple[SurfaceKey, ...]:
        """Those of ``template.surfaces``, of both sides."""
        return of_both_sides(settings.template.surfaces)

    @classmethod
    def new_networks(cls, settings: MeshGroups) -> dict[str, MeshNetwork]:
        """One network for all surfaces."""
        form = settings.network.as_dict() | {"template": settings.template, "generator": settings.training.seed}
        return {"meshes": MeshNetwork(**form)}

    @classmethod
    def train_parts(cls, examples: ExampleSets, settings: MeshGroups, run: Run) -> dict[str, Part]:
        """Train the network. It is validated on the meshes of the last stage."""
        training, weights, keys = settings.training, settings.loss, cls.surfaces_of(settings)
        network, device = run.networks["meshes"], run.device
        for key in keys:
            box = mean_box([item.targets[key] for item in examples.training])
            network.templates[template_name(key)].box.copy_(box)
        network.to(device)
        templates = {side: coarse_template(network, side, training.n_faces).to(device) for side in HEMISPHERES}
        truths = [{key: curved_target(item.targets[key].to(device)) for key in keys} for item in examples.training]
        fractions = [true_fractions(item) for item in examples.training]

        def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
            image = examples.training[index].scan.image
            maps = network.unet(scaled_image(image).to(device))
            total = weights.segmentation * segmentation_loss(network.segmentation(maps), fractions[index].to(device))
            for side, template in templates.items():
                for found in network.surfaces_after(maps, image, template, side):
                    for kind, mesh in found.items():
                        target = truths[index][side, kind]
                        total = total + weights.of(kind).mesh_loss(mesh, target, training.n_samples, draws)
            return total

        surfaces = [{key: Surface(item.targets[key]) for key in keys} for item in examples.validation]

        @torch.no_grad()
        def validate() -> dict:
            pairs = []
            for item, true in zip(examples.validation, surfaces, strict=True):
                maps = network.unet(scaled_image(item.scan.image).to(device))
                for side, template in templates.items():
                    found = network.surfaces_after(maps, item.scan.image, template, side)[-1]
                    pairs += [(mesh, true[side, kind]) for kind, mesh in found.items()]
            return mean_distances(pairs, training.n_points)

        place = run.place("meshes")
        return {"meshes": train_part(network, settings, examples, keys, loss_of, validate, place, run.progress)}

    @torch.no_grad()
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The templates after the last stage."""
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
