"""The cortex of one synthetic subject: white and pial surfaces of both hemispheres, from parameters and a seed."""

import dataclasses
import math
from typing import Literal

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface
from meshot.mesh import Mesh
from meshot.mesh.geometry import safe_norm
from meshot.rng import Generator, numpy_generator
from meshot.synth.folding import SUBDIVISIONS, template_cortex, template_thickness
from meshot.synth.procedural import procedural_cortex
from meshot.synth.separation import kept_apart
from meshot.synth.warp import VARIATION_MM, HeadWarp, random_warp, smooth_variation
from meshot.types import Bool, Float, Tensor

Kind = Literal["template", "procedural"]
#: Factors on the deformations of a subject, tried one after another until its surfaces do not intersect.
STRENGTHS = (1.0, 0.7, 0.4, 0.0)
Cortex = tuple[Mesh, Mesh, Bool[Tensor, " V"]]


@dataclasses.dataclass(frozen=True, eq=False)
class CorticalSurfaces:
    """The surfaces of one subject, in mm; x increases from left to right, y to the front, z upwards.

    All four are closed, oriented outwards, with χ = 2, and no two of their faces intersect. Each white surface
    therefore lies inside its pial surface, and the hemispheres are disjoint. Coordinates are multiples of 2⁻¹³ mm.

    Parameters
    ----------
    white, pial : dict
        By "left" and "right". Vertex i of the pial surface corresponds to vertex i of the white one, and both have the
        same faces.
    wall : dict
        By "left" and "right": which vertices belong to the medial wall, where there is no cortex and the two surfaces
        are about .1 mm apart.
    strength : float
        The factor by which the deformations of this subject were scaled to prevent intersections: 1 for nearly all.
    warp : HeadWarp, optional
        The deformation of the whole head from the space of the template, if it is known.

    Raises
    ------
    ValueError
        If a hemisphere is missing, or the two surfaces of one have different faces.
    """

    white: dict[Hemisphere, Mesh]
    pial: dict[Hemisphere, Mesh]
    wall: dict[Hemisphere, Bool[Tensor, " V"]]
    strength: float = 1.0
    warp: HeadWarp | None = None

    def __post_init__(self):
        for name in ("white", "pial", "wall"):
            if set(getattr(self, name)) != set(HEMISPHERES):
                raise ValueError(f"{name} has {sorted(getattr(self, name))}; left and right are needed")
        for side in HEMISPHERES:
            if not torch.equal(self.white[side].faces, self.pial[side].faces):
                raise ValueError(f"the faces of the {side} white and pial surface differ; vertices must correspond")
            if len(self.wall[side]) != len(self.white[side].vertices):
                raise ValueError(
                    f"the {side} wall names {len(self.wall[side])} vertices; the surface has "
                    f"{len(self.white[side].vertices)}"
                )

    def thickness(self, side: Hemisphere) -> Float[Tensor, " V"]:
        """The distance from each white vertex to its pial vertex, in mm; NaN on the medial wall."""
        distances = safe_norm(self.pial[side].vertices - self.white[side].vertices)
        return torch.where(self.wall[side], torch.full_like(distances, torch.nan), distances)

    def meshes(self) -> list[Mesh]:
        """Left white, left pial, right white, right pial."""
        return [surfaces[side] for side in HEMISPHERES for surfaces in (self.white, self.pial)]


@dataclasses.dataclass(frozen=True)
class Shape:
    """Parameters of a subject's anatomy. Every ``_sd`` is a standard deviation; with 0 there is no such variation.

    Parameters
    ----------
    kind : str
        "template": made from fsaverage5. "procedural": with folds that are not derived from a brain.
    subdivisions : int
        Subdivisions of an icosahedron, 5, 6 or 7: each surface has 10 · 4ˢ + 2 vertices, 40 962 for 6. With 5,
        procedural folds of depth 1 are too fine for the triangles.
    size_sd : float
        Variation between subjects of the logarithm of the size along each axis.
    warp_mm : tuple
        Variation between subjects by a smooth diffeomorphism: the standard deviation of its velocity along each axis,
        in mm per unit of time, at scales of 48, 24, 12, … mm. Empty for none.
    folding, folding_sd, folding_variation : float
        Depth of the folds relative to the template: mean over subjects, variation between subjects, and (template only)
        variation over the surface.
    thickness, thickness_sd, thickness_variation : float
        Median thickness of the cortex before the warp in mm, variation between subjects in mm, and relative variation
        over the surface.
    atrophy, atrophy_sd : float
        Distance by which white and pial surface are moved inwards, in mm. Sulci become wider by twice as much.
    mirrored : bool, optional
        Whether each side is the mirror image of the other side of the template.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    kind: Kind = "template"
    subdivisions: int = 6
    size_sd: float = 0.04
    warp_mm: tuple[float, ...] = (2.5, 1.6, 1.0, 0.4)
    folding: float = 1.15
    folding_sd: float = 0.05
    folding_variation: float = 0.1
    thickness: float = 2.5
    thickness_sd: float = 0.1
    thickness_variation: float = 0.06
    atrophy: float = 0.0
    atrophy_sd: float = 0.0
    mirrored: bool | None = None

    def __post_init__(self):
        object.__setattr__(self, "warp_mm", tuple(float(size) for size in self.warp_mm))
        if self.kind not in ("template", "procedural"):
            raise ValueError(f"kind is {self.kind!r}; template or procedural is needed")
        if not isinstance(self.subdivisions, int) or not SUBDIVISIONS <= self.subdivisions <= 7:
            raise ValueError(f"subdivisions is {self.subdivisions!r}; an integer from {SUBDIVISIONS} to 7 is needed")
        if self.mirrored not in (None, False, True):
            raise ValueError(f"mirrored is {self.mirrored!r}; true or false is needed")
        others = ("kind", "subdivisions", "warp_mm", "mirrored")
        numbers = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name not in others}
        for name, value in [*numbers.items(), *(("warp_mm", size) for size in self.warp_mm)]:
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value!r}; a finite number >= 0 is needed")
        for name, low, high in (("folding", 0.5, 1.4), ("thickness", 1.0, 4.0), ("atrophy", 0.0, 1.5)):
            if not low <= numbers[name] <= high:
                raise ValueError(f"{name} is {numbers[name]!r}; it must lie in [{low:g}, {high:g}]")

    def without_variation(self) -> "Shape":
        """The mean of all subjects: the same parameters without random variation."""
        still = {f.name: 0.0 for f in dataclasses.fields(self) if f.name.endswith(("_sd", "_variation"))}
        return dataclasses.replace(self, warp_mm=(), **still)


def synthetic_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """Make the cortex of a subject. The same shape and seed give the same subject.

    Both hemispheres are folded, then scaled and warped by one diffeomorphism, so that they do not overlap. Remaining
    intersections of triangles are removed by smoothing. If that fails, all random variation is reduced, see
    ``CorticalSurfaces.strength``.

    Parameters
    ----------
    shape : Shape
    seed : generator or int

    Raises
    ------
    ValueError
        If the mean subject of this shape has intersecting surfaces.
    """
    child = int(numpy_generator(seed).integers(2**62))
    for strength in STRENGTHS:
        rng = np.random.default_rng(child)
        cortices = _cortices(shape, strength, rng)
        cortices = [_mirrored(cortex) for cortex in reversed(cortices)] if shape.mirrored else cortices
        meshes = [mesh for white, pial, _ in cortices for mesh in (white, pial)]
        warp = random_warp(meshes, strength * shape.size_sd, tuple(strength * size for size in shape.warp_mm), rng)
        apart = kept_apart(warp.of_meshes(meshes))
        if apart is not None:
            walls = dict(zip(HEMISPHERES, (wall for _, _, wall in cortices), strict=True))
            white, pial = (dict(zip(HEMISPHERES, apart[first::2], strict=True)) for first in (0, 1))
            return CorticalSurfaces(white, pial, walls, strength, warp)
    raise ValueError(f"the surfaces of {shape} cross even without variation; lower folding, thickness or atrophy")


def template_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """A subject made from fsaverage5: see :func:`meshot.synth.synthetic_subject`."""
    return synthetic_subject(dataclasses.replace(shape, kind="template"), seed)


def procedural_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """A subject with procedural folds: see :func:`meshot.synth.synthetic_subject`."""
    return synthetic_subject(dataclasses.replace(shape, kind="procedural"), seed)


def mean_surfaces(shape: Shape | None = None) -> CorticalSurfaces:
    """The mean subject of a shape: a prediction that does not depend on the scan.

    Parameters
    ----------
    shape : Shape, optional
        Used without its random variation. By default the refined fsaverage5 surfaces.
    """
    shape = Shape(folding=1.0, thickness=template_thickness()) if shape is None else shape
    return template_subject(shape.without_variation(), 0)


def _cortices(shape: Shape, strength: float, rng: np.random.Generator) -> list[Cortex]:
    """White surface, pial surface and wall of each side, before the warp."""
    folding, thickness, atrophy = (
        mean + strength * sd * float(np.clip(rng.standard_normal(), -2, 2))
        for mean, sd in (
            (shape.folding, shape.folding_sd),
            (shape.thickness, shape.thickness_sd),
            (shape.atrophy, shape.atrophy_sd),
        )
    )
    make = _template if shape.kind == "template" else _procedural
    return [make(side, shape, strength, (folding, thickness, max(atrophy, 0.0)), rng) for side in HEMISPHERES]


def _mirrored(cortex: Cortex) -> Cortex:
    """The cortex of the other side: x is reversed, and so is the order of the corners of every face."""
    white, pial, wall = cortex
    flip = torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64)
    return *(Mesh(mesh.vertices * flip, mesh.faces.flip(1)) for mesh in (white, pial)), wall


def _template(
    side: Hemisphere, shape: Shape, strength: float, subject: tuple[float, float, float], rng: np.random.Generator
) -> Cortex:
    folding, thickness, atrophy = subject
    fields = smooth_variation(fsaverage5_surface("white", side).vertices, VARIATION_MM, rng, 2)
    depth = folding * (1 + strength * shape.folding_variation * fields[:, 0])
    scale = thickness / template_thickness() * (1 + strength * shape.thickness_variation * fields[:, 1])
    return template_cortex(side, shape.subdivisions, depth, scale, atrophy)


def _procedural(
    side: Hemisphere, shape: Shape, strength: float, subject: tuple[float, float, float], rng: np.random.Generator
) -> Cortex:
    folding, thickness, atrophy = subject
    variation = strength * shape.thickness_variation
    return procedural_cortex(side, shape.subdivisions, folding, thickness, variation, atrophy, rng)
