"""DDOT, CortexODE and windows: systems that deform initial white surfaces by flows, one network per hemisphere.

A second flow of each side can carry the white surface that was found to the pial surface. It is trained after the white
ones, which stay as they are: see the setting ``training.surface``.
"""

import dataclasses
import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
import scipy.ndimage
import torch

from meshot.anatomy import Hemisphere
from meshot.flow import METHODS, integrate
from meshot.loss import SummedLoss, SurfaceLoss, loss_setting_names, surface_loss
from meshot.mesh import Mesh, safe_norm, simplified, vertex_normals
from meshot.metrics import Surface, SurfaceSample, corresponds
from meshot.model import N_STEPS, DeformationNetwork, ImageVelocity, Intensities, network_digest
from meshot.settings import Count, Length, PartialSettings, Positive, Settings, Within, one_of
from meshot.systems.learning import SURFACES, FlowTrainingSettings, mean_distances, of_both_sides, train_on_subjects
from meshot.systems.protocol import SHIPPED, Example, ExampleSets, Part, Run, Scan, SurfaceKey, SurfaceSystem
from meshot.train import SCHEDULES, Progress, Training, chosen_device, data_record, require_examples
from meshot.types import PLACEMENTS, Array, Float, Tensor
from meshot.volume import Volume, mm_to_voxel, resample, sample_volume, voxel_sizes

# Settings of a deformation network and its training, as in a YAML file.


@dataclasses.dataclass(frozen=True)
class DeformationSettings(FlowTrainingSettings):
    """Settings of the training of a deformation network: those of all trainings of flows, with other defaults.

    Parameters
    ----------
    n_epochs, learning_rate, schedule, n_faces, n_flow_steps, method, validate_every, n_points
        See :class:`meshot.systems.LearningSettings` and
        :class:`meshot.systems.FlowTrainingSettings`.
    surface : str
        "white": the flow carries the initial surface to the white one. "pial": it carries the white surface, which
        the flows of ``white`` find, to the pial one.
    white : str, optional
        For pial surfaces: the folder with the flows of the white surfaces; by default those of the package.
    matching : float
        For pial surfaces: the factor of a second term of the loss, in 1/mm. It is the mean distance between every
        moved vertex and the place on the true pial surface that corresponds to the nearest point of the true white
        surface; squared and halved below 1 mm. Vertices that lie more than 1 mm from the true white surface, or on
        another bank, do not count. CortexODE has the mean of the squares, from true white surfaces. 0: no such term.
    """

    n_epochs: Count = 300
    learning_rate: Positive = 1e-4
    schedule: Annotated[str, one_of(SCHEDULES)] = "constant"
    n_faces: Count = 80_000
    n_flow_steps: Count = N_STEPS
    method: Annotated[str, one_of(METHODS)] = "euler"
    validate_every: Count = 1
    n_points: Count = 20_000
    surface: Annotated[str, one_of(("white", "pial"))] = "white"
    white: str | None = None
    matching: Annotated[float, Within(0, 1e6)] = 0.0

    def __post_init__(self):
        super().__post_init__()
        if self.matching and self.surface != "pial":
            raise ValueError(
                f"training.matching is {self.matching:g} and training.surface is {self.surface!r}; places that "
                "correspond are known for pial surfaces only: set training.matching=0 or training.surface=pial"
            )


@dataclasses.dataclass(frozen=True)
class DeformationNetworkSettings(PartialSettings):
    """Architecture: see :class:`meshot.model.DeformationNetwork`, which has the defaults."""

    width: Annotated[int, Within(1, 2048)] | None = None
    hidden: Sequence[Annotated[int, Within(1, 2048)]] | None = None
    n_scales: Annotated[int, Within(1, 15)] | None = None
    size: Annotated[int, Within(1, 15)] | None = None
    extent: Length | None = None
    velocity_unit: Length | None = None
    intensities: Intensities | None = None


def _as_loss(value: object, name: str) -> SurfaceLoss | SummedLoss:
    if not isinstance(value, SurfaceLoss | SummedLoss | Mapping):
        raise ValueError(f"{name} is {value!r}; settings of a loss are needed, such as {{loss: chamfer}}")
    return surface_loss(value) if isinstance(value, Mapping) else value


@dataclasses.dataclass(frozen=True)
class DeformationConfig(Settings):
    """All settings of a network: the groups ``network``, ``loss`` and ``training`` of a file.

    Parameters
    ----------
    network : DeformationNetworkSettings
    training : DeformationSettings
    loss : SurfaceLoss or SummedLoss
        In a file, the settings that :func:`meshot.loss.surface_loss` reads.
    """

    network: DeformationNetworkSettings
    training: DeformationSettings
    loss: Annotated[SurfaceLoss | SummedLoss, _as_loss] = dataclasses.field(default_factory=SurfaceLoss)

    def as_dict(self) -> dict:
        """The settings by group, as in a file."""
        return super().as_dict() | {"loss": self.loss.settings()}

    def new_network(self) -> DeformationNetwork:
        """The untrained network in float32. Its weights are determined by the seed."""
        return DeformationNetwork(**self.network.as_dict(), generator=self.training.seed).float()


# Application of a trained network: deformation of an initial surface by the flow.


def standardised(image: Volume, surface: Mesh) -> Volume:
    """An image scaled to mean 0 and standard deviation 1 over the vertices of a surface.

    In an image scaled to [0, 1], the border of white matter is a change of about 1/12 around a value of .6, which is
    small compared with the mean. Standardising removes the mean, and also gain and offset of the scanner. The surface
    is in the space of the image.

    Raises
    ------
    ValueError
        If the image is constant over the surface, for example because they are in different spaces.
    """
    values = sample_volume(image, surface.vertices.double())
    mean, spread = float(values.mean()), float(values.std())
    if not spread > 0:
        raise ValueError(
            f"the image is {mean:.4g} at every vertex of the surface; are both in the same space, and is the scan a T1?"
        )
    return image.with_data(((image.data - mean) / spread).astype(np.float32))


#: Where the levels of white and grey matter are read, along the normal of the initial surface, in mm.
_WHITE_AT, _GREY_AT = (-2.5, -2.0, -1.5), (1.0, 1.25, 1.5)
_NEAR_MM, _COARSE_MM = 15.0, 5.0  # standard deviation of the means of the levels, and the grid on which they are taken


def scaled_between_tissues(image: Volume, surface: Mesh) -> Volume:
    """An image in which white matter near a surface is 1 and grey matter -1, so that their border is near 0.

    Along the normal of every vertex, the level of white matter is the median of three values 1.5 to 2.5 mm inside, and
    that of grey matter of three values 1 to 1.5 mm outside. Both are averaged over vertices that are near, by a
    Gaussian with a standard deviation of 15 mm. So the 0 does not depend on the contrast, and little on a smooth bias
    field. On a sphere of white matter of 25 mm, a surface up to 0.5 mm inside the border or 1 mm outside moves it by
    about a tenth of half the contrast; one that lies 1 mm inside, by half.
    :func:`meshot.systems.standardised` takes the values at the surface itself instead.

    Parameters
    ----------
    image : Volume
        A T1 in mm.
    surface : Mesh
        An approximate white surface in the space of the image, with outward normals.

    Raises
    ------
    ValueError
        If white matter is not brighter than grey matter in the median over the vertices.
    """
    vertices = surface.vertices.detach().double()
    normals = vertex_normals(surface.with_vertices(vertices))

    def level(depths: tuple[float, ...]) -> Float[Array, " V"]:
        values = torch.stack([sample_volume(image, vertices + depth * normals) for depth in depths])
        return values.median(dim=0).values.numpy()

    white, grey = level(_WHITE_AT), level(_GREY_AT)
    if not np.median(white) > np.median(grey):
        raise ValueError(
            f"white matter beside the surface has the value {np.median(white):.4g} and grey matter "
            f"{np.median(grey):.4g}; in a T1 white matter is brighter: are surface and image in the same space?"
        )
    # Sums over near vertices are taken on a coarse grid. Where no vertex is near, the levels are the means over all.
    step = np.maximum(np.round(_COARSE_MM / voxel_sizes(image)), 1)
    shape = tuple((np.ceil(np.array(image.data.shape) / step) + 1).astype(int))
    places = np.clip(np.round(mm_to_voxel(image, vertices).numpy() / step), 0, np.array(shape) - 1).astype(int)
    sums = []
    for values in (np.ones(len(white)), white, grey):
        total = np.full(shape, 1e-6 * values.mean())
        np.add.at(total, tuple(places.T), values)
        sums.append(scipy.ndimage.gaussian_filter(total, _NEAR_MM / (step * voxel_sizes(image)), truncate=3))
    whites, greys = (total / sums[0] for total in sums[1:])
    half = np.maximum(whites - greys, 0.1 * (np.median(white) - np.median(grey))) / 2
    coarse = image.affine @ np.diag([*step, 1.0])
    middle, half = (
        resample(Volume(level, coarse), image.data.shape, image.affine).data for level in ((whites + greys) / 2, half)
    )
    return image.with_data(((image.data - middle) / half).astype(np.float32))


def velocity_field(network: DeformationNetwork, image: Volume, surface: Mesh) -> ImageVelocity:
    """The velocity field of a network in an image that is scaled over, or beside, a surface."""
    # It follows the network when its weights change.
    path = "visited" if next(network.parameters()).device.type == "cpu" else "cut"
    scaled = standardised if network.intensities == "surface" else scaled_between_tissues
    return network.velocity_in(scaled(image, surface), path)


@torch.no_grad()
def deformed(
    initial: Mesh,
    image: Volume,
    network: DeformationNetwork,
    n_steps: int = N_STEPS,
    method: str = "euler",
    standard: Mesh | None = None,
) -> Mesh:
    """Deform an initial surface by the flow of a network in an image.

    Parameters
    ----------
    initial : Mesh
        In the space of the image, in mm. It may have any number of vertices, since the flow is defined everywhere.
    image : Volume
        On the standard grid. Its gain and offset do not matter, see :func:`meshot.systems.standardised`.
    network : DeformationNetwork
    n_steps, method : int, str
        See :func:`meshot.integrate`.
    standard : Mesh, optional
        The image is standardised over the vertices of this surface, by default those of ``initial``. For the coarse
        surface of a training it is the whole initial surface, as in the training.

    Returns
    -------
    Mesh
        With the faces, dtype and device of ``initial``.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate` and :func:`meshot.systems.standardised`; or if the flow gives positions
        that are not finite.
    """
    parameter = next(network.parameters())
    start = initial.vertices.to(parameter)
    # Only the displacement is rounded to the network's precision, not the initial position.
    field = velocity_field(network, image, initial if standard is None else standard)
    moved = integrate(field, start, n_steps, method) - start
    if not bool(torch.isfinite(moved).all()):
        raise ValueError("the flow leads to vertices that are not finite: is the network trained?")
    return initial.with_vertices(initial.vertices + moved.to(initial.vertices))


# Training data of a deformation network: the surface before the flow and the true one of a hemisphere, and the scan.


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationExample:
    """One hemisphere of one subject in the standard space, with meshes and scan in float32.

    Parameters
    ----------
    name : str
    scan : Volume
        On the standard grid, in [0, 1].
    initial : Mesh
        The surface before the flow: the initial one, or for a pial surface the white one that was found.
    coarse : Mesh
        The same with fewer faces, for training.
    target : Mesh
        The true surface.
    places : tensor, optional
        For a pial surface with the faces of the white one: where the vertices of ``coarse`` belong, see
        ``matched_places``.
    """

    name: str
    scan: Volume
    initial: Mesh
    coarse: Mesh
    target: Mesh
    places: Float[Tensor, "V 3"] | None = None


def hemisphere_example(
    example: Example, side: Hemisphere, n_faces: int, white: "DeformationSystem | None" = None
) -> DeformationExample:
    """One hemisphere of an example, which has its initial white surface, with ``n_faces`` faces in the coarse one.

    With the flows of white surfaces the example is one for pial surfaces.
    """
    image = example.scan.image
    initial = example.scan.initial[side, "white"] if white is None else white.white_surface(example.scan, side)
    coarse = simplified(initial, n_faces)
    truths = [example.targets.get((side, kind)) for kind in ("white", "pial")]
    places = matched_places(coarse, *truths) if white is not None and corresponds(*truths) else None
    return DeformationExample(
        example.name,
        image.with_data(image.data.astype(np.float32)),
        initial.to(torch.float32),
        coarse.to(torch.float32),
        example.targets[side, "white" if white is None else "pial"].to(torch.float32),
        places,
    )


_MATCHED_MM, _MATCHED_COSINE = 1.0, 0.3


def matched_places(found: Mesh, white: Mesh, pial: Mesh) -> Float[Tensor, "V 3"]:
    """Where the vertices of a white surface belong on the true pial surface, in float32.

    It is the place that corresponds to the nearest point of the true white surface. NaN where that point is more than
    1 mm away, or the normals differ by more than 73°, as where a gyrus is cut off.
    """
    truth, points = Surface(white), found.vertices.detach().double().numpy()
    near = truth.offsets(SurfaceSample(points, vertex_normals(found).detach().double().numpy()))
    matched = (near.distances < _MATCHED_MM) & (near.cosines > _MATCHED_COSINE)
    return torch.from_numpy(np.where(matched[:, None], truth.carry(points, pial), np.nan)).float()


def matching_loss(vertices: Float[Tensor, "V 3"], places: Float[Tensor, "V 3"]) -> Float[Tensor, ""]:
    """The mean distance of vertices to their places in mm, squared and halved below 1 mm. Places with NaN are left out.

    The Huber loss. Zero if no vertex has a place.
    """
    known = ~places.isnan().any(dim=1)
    distances = safe_norm(vertices[known] - places[known])
    return torch.nn.functional.huber_loss(distances, torch.zeros_like(distances), reduction="sum") / max(
        len(distances), 1
    )


def digest(examples: Sequence[DeformationExample]) -> str:
    """The SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.data.tobytes())
        for mesh in (item.initial, item.coarse, item.target):
            total.update(mesh.vertices.numpy().tobytes() + mesh.faces.numpy().tobytes())
        total.update(b"" if item.places is None else item.places.numpy().tobytes())
    return total.hexdigest()


# Algorithm 1 of the paper: training of a network whose flow moves initial surfaces to true ones.


def train_deformation(
    config: DeformationConfig,
    training: Sequence[DeformationExample],
    validation: Sequence[DeformationExample],
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
    network: DeformationNetwork | None = None,
) -> Training:
    """Train a network from its initial weights, or resume a stopped training.

    Parameters
    ----------
    config : DeformationConfig
    training, validation : sequence of DeformationExample
        Of the side in the configuration. The best network is the one with the smallest mean ASSD in validation.
    folder : path, optional
        The folder for the state (``training.safetensors``) and the log (``log.jsonl``). If it contains a state, the
        training resumes from it. On one thread, the final weights are the same as without the interruption.
    progress : callable of (steps done, number of steps, line of the log), optional
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.
    network : DeformationNetwork, optional
        The untrained network of the configuration, which is trained. By default a new one.

    Raises
    ------
    ValueError
        If there are no examples, the scan of a training example is constant over its surface, or the folder contains
        a different training.
    FloatingPointError
        As :func:`meshot.systems.train_on_subjects`.

    References
    ----------
    Le et al., ICLR 2024, Algorithm 1.
    """
    require_examples(training, validation)
    settings, device = config.training, device or chosen_device()
    unmatched = [item.name for item in training if item.places is None]
    if settings.matching and unmatched:
        raise ValueError(
            f"the true white and pial surfaces of {unmatched[0]} have different faces, so that no places correspond: "
            "set training.matching=0, or take surfaces that correspond, such as FreeSurfer's"
        )
    network = (network or config.new_network()).to(device)
    fields = [velocity_field(network, item.scan, item.initial) for item in training]
    targets = [Surface(item.target) for item in validation]

    def loss_of(index: int, done: float, draws: np.random.Generator) -> Tensor:
        item = training[index]
        predicted = carried(item.coarse.to(device), fields[index], settings)
        loss = config.loss.at(done)(predicted, item.target.to(device), draws)
        if not settings.matching:
            return loss
        return loss + settings.matching * matching_loss(predicted.vertices, item.places.to(device))

    def validate() -> dict:
        flow = (settings.n_flow_steps, settings.method)
        found = (deformed(item.initial, item.scan, network, *flow) for item in validation)
        return mean_distances(zip(found, targets, strict=True), settings.n_points)

    names = [item.name for item in training]
    made_with = config.as_dict() | {"data": data_record(training, validation, digest)}
    return train_on_subjects(network, settings, names, loss_of, validate, made_with, folder, progress)


def carried(mesh: Mesh, field: ImageVelocity, settings: DeformationSettings) -> Mesh:
    """The predicted mesh: a mesh after the flow. Differentiable with respect to the network's parameters."""
    return mesh.with_vertices(integrate(field, mesh.vertices, settings.n_flow_steps, settings.method))


# The systems, which differ in their losses.

_KEYS = of_both_sides(("white",))
#: The networks of the flows from white to pial surfaces.
PIAL_PARTS = ("left_pial", "right_pial")
#: In the record of such a network: the digest of the flow whose white surfaces it learned from.
WHITE = "white_sha256"


class DeformationSystem(SurfaceSystem):
    """A system that deforms initial white surfaces. A subclass sets ``name`` and ``loss``.

    Attributes
    ----------
    loss : dict
        Default settings of the loss, in the format of ``loss`` in a YAML file.
    """

    groups = DeformationConfig
    surfaces = needs = _KEYS
    networks = {  # noqa: RUF012 (of the class, by the protocol)
        "_".join(key): DeformationNetwork for key in of_both_sides(SURFACES[1])
    }
    loss: ClassVar[dict] = {}

    def __init__(self, parts: Mapping[str, Part]):
        # The flows of pial surfaces are trained later, and not by everyone: the white ones do not know of them.
        pial = {name: part for name, part in parts.items() if name in PIAL_PARTS}
        super().__init__({name: part for name, part in parts.items() if name not in pial})
        for name, part in pial.items():
            self.settings[name] = self._recorded(name, part.record)
            placement = part.record.get("results", {}).get("placement", PLACEMENTS[0])
            if self.parts and placement != self.placement:
                raise ValueError(
                    f"scans were placed by {self.placement} for the white surfaces of {self.name}, and by {placement} "
                    f"for {name}; train both on one cohort"
                )
            self.placement = placement
            white, learned = self.parts.get(name.replace("pial", "white")), part.record.get("results", {}).get(WHITE)
            if white is not None and learned not in (None, network_digest(white.network)):
                raise ValueError(
                    f"{name} of {self.name} learned from white surfaces of another flow: take those of its training, "
                    f"or train it anew (meshot train {self.name} --set training.surface=pial training.white=FOLDER)"
                )
        self.parts |= pial
        if pial:
            self.surfaces, self._needed = of_both_sides(SURFACES[1]), tuple(self.networks)

    @classmethod
    def surfaces_of(cls, settings: DeformationConfig) -> tuple[SurfaceKey, ...]:
        """The white surfaces; in a training of flows to pial surfaces these, too."""
        return of_both_sides(SURFACES[1]) if settings.training.surface == "pial" else cls.surfaces

    @classmethod
    def parts_of(cls, settings: DeformationConfig) -> tuple[str, ...]:
        """The flows of the white surfaces."""
        return tuple("_".join(key) for key in _KEYS)

    def with_white_only(self) -> "DeformationSystem":
        """Without the flows to pial surfaces."""
        return type(self)({name: part for name, part in self.parts.items() if name not in PIAL_PARTS})

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "DeformationSystem":
        """Load the flows of the white surfaces, and those of pial surfaces if both are in the folder."""
        white, there = super().load(folder), [Path(folder) / f"{name}.safetensors" for name in PIAL_PARTS]
        if not all(path.is_file() for path in there):
            return white
        return cls(white.parts | {path.stem: cls.read_part(folder, path.stem) for path in there})

    @classmethod
    def complete(cls, settings: Settings | Mapping[str, object]) -> DeformationConfig:
        """All settings. Of the loss of the system, those remain that the given loss and encoding use."""
        if isinstance(settings, Mapping) and isinstance(settings.get("loss", {}), Mapping):
            given = settings.get("loss", {})
            chosen, loss = {"terms", "loss", "encoding"} & given.keys(), cls.loss | given
            if "terms" in chosen or "terms" in cls.loss:
                loss = given if chosen else loss
            else:
                names = {name: given.get(name) or cls.loss[name] for name in ("loss", "encoding")}
                used = loss_setting_names(**names)
                loss = {name: value for name, value in cls.loss.items() if name in used} | names | given
            settings = {**settings, "loss": loss}
        return super().complete(settings)

    @classmethod
    def new_networks(cls, settings: DeformationConfig) -> dict[str, DeformationNetwork]:
        """A network for each side in the settings."""
        return {f"{side}_{settings.training.surface}": settings.new_network() for side in settings.training.sides}

    @classmethod
    def train_parts(cls, examples: ExampleSets, settings: DeformationConfig, run: Run) -> dict[str, Part]:
        """Train the networks, one after the other."""
        parts, surface, white = {}, settings.training.surface, None
        if surface == "pial":
            white = cls.load(SHIPPED / cls.name if settings.training.white is None else settings.training.white)
        for side in settings.training.sides:
            name, training = f"{side}_{surface}", dataclasses.replace(settings.training, side=side)
            own = dataclasses.replace(settings, training=training)
            sets = (
                [hemisphere_example(example, side, training.n_faces, white) for example in part]
                for part in (examples.training, examples.validation)
            )
            found = train_deformation(own, *sets, run.place(name), run.progress, run.device, run.networks[name])
            learned = {} if white is None else {WHITE: network_digest(white.parts[f"{side}_white"].network)}
            parts[name] = Part(found.network, own.as_dict() | {"results": found.results() | learned}, found.log)
        return parts

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The initial surfaces moved to the white ones, and these to the pial ones, if there are flows for them."""
        found = {}
        for side, kind in self.surfaces:
            start = scan.initial[side, "white"] if kind == "white" else found[side, "white"]
            found[side, kind] = self._moved(f"{side}_{kind}", start, scan)
        return found

    def white_surface(self, scan: Scan, side: Hemisphere) -> Mesh:
        """The white surface of one side."""
        return self._moved(f"{side}_white", scan.initial[side, "white"], scan)

    def _moved(self, part: str, start: Mesh, scan: Scan) -> Mesh:
        network, training = self.parts[part].network, self.settings[part].training
        return deformed(start, scan.image, network, training.n_flow_steps, training.method)


class Ddot(DeformationSystem):
    """DDOT: sliced Wasserstein distances between oriented varifolds."""

    # The paper states no length of the scaled normals; 1 mm is one interpretation. Le et al., *Diffeomorphic Mesh
    # Deformation via Efficient Optimal Transport for Cortical Surface Reconstruction*, ICLR 2024.

    name = "ddot"
    loss = {"loss": "sliced", "encoding": "varifold", "normal_scale": 1.0}  # noqa: RUF012


class CortexOde(DeformationSystem):
    """CortexODE: squared Chamfer distances between sampled points. Only the loss differs from the other systems here.

    The factor of the loss is that of the authors; it has almost no effect with Adam. Ma et al., *CortexODE: Learning
    Cortical Surface Reconstruction by Neural ODEs*, IEEE Transactions on Medical Imaging, 2022.
    """

    name = "cortexode"
    loss = {"loss": "chamfer", "encoding": "samples", "factor": 1000.0}  # noqa: RUF012


class Windows(DeformationSystem):
    """Sliced Wasserstein distances between varifolds, in windows around positions of the target. Not in the paper."""

    # In windows of 6 mm, missing area does not affect vertices far away: see chapter 19. With the setting
    # ``loss.last_window=3`` their radius falls to 3 mm during the training. The settings ``combined`` have the loss
    # that chapter 27 chooses. With this loss the flows of the package are trained: see the settings ``shipped``.

    name = "windows"
    loss = {  # noqa: RUF012
        "loss": "windowed",
        "encoding": "varifold",
        "window": 6.0,
        "n_windows": 32,
        "n_directions": 16,
        "normal_scale": 8.0,
        "p": 1,
    }
