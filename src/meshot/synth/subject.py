"""The cortex of one synthetic subject: white and pial surfaces of both hemispheres, from a few knobs and a seed."""

import dataclasses
from typing import Literal

from meshot.mesh.geometry import safe_norm
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import split_in_four
from meshot.rng import Generator
from meshot.synth.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface
from meshot.types import Bool, Float, Tensor

Kind = Literal["template", "procedural"]


@dataclasses.dataclass(frozen=True, eq=False)
class CorticalSurfaces:
    """The surfaces of one subject, in mm; x grows from left to right, y to the front, z upwards.

    Parameters
    ----------
    white, pial : dict
        Of "left" and "right": closed, outward, χ = 2. Vertex i of the pial surface lies over vertex i of the white one,
        and both have the same faces.
    wall : dict
        Of "left" and "right": which vertices belong to the medial wall, where there is no cortex and the two surfaces
        lie almost on each other.
    strength : float
        By which the deformations of this subject had to be scaled down to keep its surfaces apart: 1 for nearly all.
    """

    white: dict[Hemisphere, Mesh]
    pial: dict[Hemisphere, Mesh]
    wall: dict[Hemisphere, Bool[Tensor, " V"]]
    strength: float = 1.0

    def thickness(self, side: Hemisphere) -> Float[Tensor, " V"]:
        """How far each white vertex is from its pial one, in mm."""
        return safe_norm(self.pial[side].vertices - self.white[side].vertices)


@dataclasses.dataclass(frozen=True)
class Shape:
    """The knobs of a subject's anatomy. Every ``_sd`` is a standard deviation; 0 switches that variation off.

    Parameters
    ----------
    kind : str
        "template": fsaverage5, folded and warped. "procedural": folds that come from no brain.
    subdivisions : int
        Of an icosahedron: each surface has 10 · 4ˢ + 2 vertices, 40 962 at 6.
    size_sd : float
        Between subjects, of the logarithm of the size along each axis.
    warp_mm : tuple
        Between subjects, of the displacement along each axis by a smooth diffeomorphism, in mm, one for each of its
        scales, see ``WARP_SPACINGS``.
    folding, folding_sd, folding_variation : float
        How deep the folds are, 1 being the template's: mean over subjects, between subjects, and from place to place.
    thickness, thickness_sd, thickness_variation : float
        The median thickness of the cortex in mm, between subjects in mm, and from place to place as a part of it.
    atrophy, atrophy_sd : float
        How far the white surface has receded, in mm, the cortex with it, so that sulci are wider by twice as much.
    """

    kind: Kind = "template"
    subdivisions: int = 6
    size_sd: float = 0.04
    warp_mm: tuple[float, ...] = (2.0, 1.5, 0.8)
    folding: float = 1.0
    folding_sd: float = 0.05
    folding_variation: float = 0.1
    thickness: float = 2.5
    thickness_sd: float = 0.1
    thickness_variation: float = 0.08
    atrophy: float = 0.0
    atrophy_sd: float = 0.0


def template_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """A subject made from fsaverage5: its folds deepened or flattened, its cortex thickened or thinned, then warped."""
    return mean_surfaces()


def procedural_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """A subject whose folds come from no brain."""
    return mean_surfaces()


def mean_surfaces(subdivisions: int = 6) -> CorticalSurfaces:
    """The template itself, refined and mended: what a guess that knows no individual would say."""
    meshes = {(kind, side): _refined(kind, side) for kind in ("white", "pial") for side in HEMISPHERES}
    white, pial = ({side: meshes[kind, side] for side in HEMISPHERES} for kind in ("white", "pial"))
    wall = {side: safe_norm(pial[side].vertices - white[side].vertices) < 0.3 for side in HEMISPHERES}
    return CorticalSurfaces(white, pial, wall)


def _refined(kind: Literal["white", "pial"], side: Hemisphere) -> Mesh:
    mesh = fsaverage5_surface(kind, side)
    return Mesh(*split_in_four(mesh.vertices, mesh.faces))


def synthetic_subject(shape: Shape, seed: Generator) -> CorticalSurfaces:
    """The subject of ``shape.kind``.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    makers = {"template": template_subject, "procedural": procedural_subject}
    if shape.kind not in makers:
        raise ValueError(f"kind is {shape.kind!r}; one of {', '.join(makers)} is needed")
    return makers[shape.kind](shape, seed)
