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

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.flow import Velocity, integrate
from meshot.loss import chamfer, squared_edge_length
from meshot.mesh import Mesh, sample_points, simplified
from meshot.metrics import Surface
from meshot.model import FeatureNetwork, sample_features
from meshot.rng import Generator
from meshot.settings import Count, Length, NotNegative, Settings
from meshot.systems.learning import (
    FlowTrainingSettings,
    Template,
    TemplateSettings,
    mean_box,
    mean_distances,
    of_both_sides,
    scaled_image,
    train_part,
)
from meshot.systems.protocol import ExampleSets, Part, Run, Scan, SurfaceKey, SurfaceSystem
from meshot.types import Float, Tensor
from meshot.volume import Volume

# Settings of CorticalFlow, as in a YAML file.


@dataclasses.dataclass(frozen=True)
class FlowSettings(Settings):
    """Architecture of every block: see :class:`meshot.systems.corticalflow.FlowBlock`."""

    width: Count = 8
    depth: Count = 4
    fold: Count = 2
    velocity_unit: Length = 10.0


@dataclasses.dataclass(frozen=True)
class ChainSettings(FlowTrainingSettings):
    """Settings of the training of every block: those of all trainings of flows, and the following."""

    n_samples: Count = 10_000  # number of points on each surface for the Chamfer loss
    # weight of the mean squared edge length (mm²), relative to the squared Chamfer loss (mm²)
    edge_weight: NotNegative = 0.1


@dataclasses.dataclass(frozen=True)
class FlowGroups(Settings):
    """All settings."""

    network: FlowSettings
    template: TemplateSettings
    training: ChainSettings


# One block of CorticalFlow: a U-Net that gives a stationary velocity grid, and a chain of blocks that carry a mesh.

INITIAL_FLOW = 1e-3  # standard deviation of the initial weights of the last layer


class FlowBlock(nn.Module):
    """A U-Net from a scan, and the velocity grids of the blocks before it, to a velocity grid."""

    # ``side``: the hemisphere of the template.
    # ``n_before``: number of blocks before this one.
    # ``box``: the box of the template, in mm.
    # ``generator``: source of the initial weights.
    # ``**architecture``: of the U-Net, see :class:`meshot.model.FeatureNetwork`: ``width``, ``depth``, ``fold``. The
    # velocity grid has the grid of its first level. ``velocity_unit``: in mm per unit of time; the output of the last
    # layer is multiplied by it.

    def __init__(
        self,
        side: Hemisphere,
        n_before: int = 0,
        *,
        template: Mapping | TemplateSettings | None = None,
        box: Tensor | None = None,
        generator: Generator = 0,
        **architecture: float,
    ):
        super().__init__()
        require_positive_integer(n_before + 1, "n_before + 1", 10)
        own = FlowSettings.read(architecture)
        self.arguments = {"side": side, "n_before": n_before, **own.as_dict()}
        self.velocity_unit = float(own.velocity_unit)
        self.template = Template(side, TemplateSettings.read(template or {}), box)
        self.features = FeatureNetwork(own.width, own.depth, own.fold, 3 * n_before, generator=generator)
        self.to_flow = nn.Conv3d(own.width, 3, 3, padding=1)
        draws = np.random.default_rng([n_before, own.width, own.depth]).standard_normal(
            tuple(self.to_flow.weight.shape)
        )
        with torch.no_grad():
            self.to_flow.weight.copy_(INITIAL_FLOW * torch.from_numpy(draws))
            self.to_flow.bias.zero_()

    def config(self) -> dict:
        """The arguments that create a network of the same architecture."""
        template = {name: getattr(self.template.settings, name) for name in ("shape", "smoothing", "splits")}
        return self.arguments | {"template": template}

    def forward(self, image: Float[Tensor, "1 1 x y z"], before: Tensor | None = None) -> Float[Tensor, "1 3 i j k"]:
        """The velocity grid, in units of ``velocity_unit``."""
        return self.to_flow(self.features(image, before)[-1])

    def velocity(self, grid: Float[Tensor, "1 3 i j k"], image: Volume) -> Velocity:
        """The velocity field of a grid, in mm per unit of time: trilinear, and constant beyond the border."""
        return lambda _, points: self.velocity_unit * sample_features([grid], image, points)

    def carry(
        self, mesh: Mesh, image: Volume, values: Tensor, before: Tensor | None, n_steps: int, method: str
    ) -> tuple[Mesh, Tensor]:
        """A mesh after the flow of this block, and all velocity grids up to this one, stacked as channels."""
        grid = self(values, before)
        moved = mesh.with_vertices(integrate(self.velocity(grid, image), mesh.vertices, n_steps, method))
        return moved, grid if before is None else torch.cat([before, grid], dim=1)


def carried_through(
    blocks: Sequence[FlowBlock], mesh: Mesh, image: Volume, values: Tensor, n_steps: int, method: str
) -> tuple[Mesh, Tensor | None]:
    """A mesh after the flows of all blocks, one after the other, and their velocity grids: see :meth:`FlowBlock.carry`.

    Without a block, the mesh itself and None.
    """
    grids = None
    for block in blocks:
        mesh, grids = block.carry(mesh, image, values, grids, n_steps, method)
    return mesh, grids


# Training of the blocks of CorticalFlow, one after the other. The earlier blocks do not change.


def train_block(
    network: FlowBlock,
    earlier: Sequence[FlowBlock],
    white: Sequence[FlowBlock],
    examples: ExampleSets,
    settings: FlowGroups,
    run: Run,
    name: str,
) -> Part:
    """Train the block after ``earlier`` ones of its cascade, which stay as they are."""
    # The cascade leads from the template to the white surface; or, behind the blocks ``white``, from the surface that
    # these find to the pial surface. The loss is the squared Chamfer distance between random points of both surfaces
    # plus ``edge_weight`` times the mean squared edge length. The state is kept under the name.
    training, side, device = settings.training, network.template.side, run.device
    network.template.box.copy_(mean_box([item.targets[side, "white"] for item in examples.training]))
    network.to(device)
    before, frozen = ([block.to(device).requires_grad_(False) for block in each] for each in (white, earlier))
    template = simplified(network.template.mesh(), training.n_faces).to(torch.float32).to(device)
    flow = (training.n_flow_steps, training.method)

    @functools.cache  # what the other blocks do in a scan is computed once
    def begun(scan: Scan) -> tuple[Tensor, Mesh, Tensor | None]:
        values = scaled_image(scan.image).to(device)
        with torch.no_grad():
            start, _ = carried_through(before, template, scan.image, values, *flow)
            return values, *carried_through(frozen, start, scan.image, values, *flow)

    def carry(scan: Scan) -> Mesh:
        values, mesh, grids = begun(scan)
        return network.carry(mesh, scan.image, values, grids, *flow)[0]

    key = (side, "pial" if white else "white")
    targets = [item.targets[key].to(torch.float32).to(device) for item in examples.training]
    truths = [Surface(item.targets[key]) for item in examples.validation]

    def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
        found = carry(examples.training[index].scan)
        points = (sample_points(mesh, training.n_samples, draws) for mesh in (found, targets[index]))
        return chamfer(*points) + training.edge_weight * squared_edge_length(found)

    @torch.no_grad()
    def validate() -> dict:
        found = (carry(item.scan) for item in examples.validation)
        return mean_distances(zip(found, truths, strict=True), training.n_points)

    return train_part(network, settings, examples, [key], loss_of, validate, run.place(name), run.progress)


N_BLOCKS = 3


def _names(key: SurfaceKey) -> list[str]:
    """The blocks whose cascade ends at a surface."""
    return [f"{'_'.join(key)}_{k + 1}" for k in range(N_BLOCKS)]


class System(SurfaceSystem):
    """CorticalFlow++: three blocks for each white surface, and three more for each pial one, if the settings say so."""

    name = "corticalflow"
    groups = FlowGroups
    networks = {  # noqa: RUF012 (of the class, by the protocol)
        name: FlowBlock for side in HEMISPHERES for kind in ("white", "pial") for name in _names((side, kind))
    }

    @classmethod
    def surfaces_of(cls, settings: FlowGroups) -> tuple[SurfaceKey, ...]:
        """Those of ``template.surfaces``, of both sides."""
        return of_both_sides(settings.template.surfaces)

    @classmethod
    def parts_of(cls, settings: FlowGroups) -> tuple[str, ...]:
        """The blocks of these surfaces."""
        return tuple(name for key in cls.surfaces_of(settings) for name in _names(key))

    @classmethod
    def new_networks(cls, settings: FlowGroups) -> dict[str, FlowBlock]:
        """The blocks of the sides in the settings."""
        form = settings.network.as_dict() | {"template": settings.template, "generator": settings.training.seed}
        return {
            name: FlowBlock(key[0], k, **form)
            for key in cls.surfaces_of(settings)
            if key[0] in settings.training.sides
            for k, name in enumerate(_names(key))
        }

    @classmethod
    def train_parts(cls, examples: ExampleSets, settings: FlowGroups, run: Run) -> dict[str, Part]:
        """Train the blocks of one side after the other; the white ones first."""
        parts: dict[str, Part] = {}
        for side in settings.training.sides:
            own = dataclasses.replace(settings, training=dataclasses.replace(settings.training, side=side))
            white: list[FlowBlock] = []
            for key in (key for key in cls.surfaces_of(settings) if key[0] == side):
                earlier: list[FlowBlock] = []
                for name in _names(key):
                    parts[name] = train_block(run.networks[name], earlier, white, examples, own, run, name)
                    earlier.append(parts[name].network)
                white = earlier
        for part in parts.values():
            part.network.cpu()
        return parts

    @torch.no_grad()
    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The templates carried by the blocks of the white surfaces, and these by the blocks of the pial ones."""
        # The flows are integrated with the settings of the training.
        values, found = scaled_image(scan.image), {}
        for key in self.surfaces:
            names = _names(key)
            blocks, training = [self.parts[name].network for name in names], self.settings[names[0]].training
            box = blocks[0].template.box
            start = blocks[0].template.mesh() if key[1] == "white" else found[key[0], "white"]
            flow = (training.n_flow_steps, training.method)
            mesh, _ = carried_through(blocks, start.to(box.device, box.dtype), scan.image, values.to(box), *flow)
            if not bool(torch.isfinite(mesh.vertices).all()):
                raise ValueError("the flow leads to vertices that are not finite: are the networks trained?")
            found[key] = mesh.to("cpu", torch.float64)
        return found
