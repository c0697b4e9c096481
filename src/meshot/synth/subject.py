"""The cortex of one synthetic subject: white and pial surfaces of both hemispheres, from parameters and a seed."""

import dataclasses
import math
from typing import Literal

import numpy as np
import scipy.ndimage
import scipy.spatial
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface
from meshot.flow import GridVelocity, grid_around, integrate, spline_values
from meshot.mesh import (
    Mesh,
    face_areas,
    icosphere,
    laplacian_smoothing,
    neighbour_means,
    safe_norm,
    self_intersecting_faces,
    signed_volume,
    smooth_crossings,
    split_in_four,
    united,
    vertex_normals,
)
from meshot.rng import Generator, numpy_generator
from meshot.settings import Settings
from meshot.types import Bool, Float, Int64, Tensor
from meshot.volume import Volume, winding_numbers

# Smooth random fields and random diffeomorphisms, which give the variation between subjects.

COARSEST = 48.0  # mm between the nodes of the coarsest grid; each further grid has half the spacing
STEEPEST = 12.0  # largest allowed Lipschitz bound, which limits the number of steps
#: Standard deviation in space of a cubic spline whose coefficients are independent with standard deviation 1:
#: the mean of the sum of squared weights along one axis is 151/315.
SPREAD = (151 / 315) ** 1.5
MARGIN = 16.0
LARGEST = 2.5  # standard deviations
VARIATION_MM = 30.0  # length scale of the variation of folding depth and cortical thickness over the surface


def random_velocity(*points: Float[Tensor, "_ 3"], warp_mm: tuple[float, ...], generator: Generator) -> GridVelocity:
    """A smooth random velocity field around the points, constant in time. Its flow is a random diffeomorphism."""
    if not warp_mm or not all(math.isfinite(size) and size >= 0 for size in warp_mm):
        raise ValueError(f"warp_mm is {warp_mm}; one number >= 0 for each scale is needed, coarse to fine, in mm")
    rng = numpy_generator(generator)
    spacings = tuple(COARSEST / 2**level for level in range(len(warp_mm)))
    field = grid_around(*points, margin=MARGIN, spacings=spacings, n_pieces=1).requires_grad_(False)
    for level, size in zip(field.levels, warp_mm, strict=True):
        level.copy_(torch.from_numpy(rng.standard_normal(tuple(level.shape))) * (size / SPREAD))
    return field


@dataclasses.dataclass(frozen=True, eq=False)
class HeadWarp:
    """The deformation of a whole head: other sizes along the axes, then the flow of a velocity."""

    sizes: Float[Tensor, " 3"]  # factors along x, y and z
    field: GridVelocity | None  # None for no flow
    n_steps: int = 1  # Runge–Kutta steps of the flow

    def forward(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Positions in the deformed head of points of the template head, in mm."""
        points = points * self.sizes
        return points if self.field is None else integrate(self.field, points, self.n_steps, "rk4").detach()

    def of_meshes(self, meshes: list[Mesh]) -> list[Mesh]:
        """The meshes after the deformation. All their vertices are integrated together."""
        moved = self.forward(torch.cat([mesh.vertices for mesh in meshes]))
        parts = moved.split([len(mesh.vertices) for mesh in meshes])
        return [mesh.with_vertices(part) for mesh, part in zip(meshes, parts, strict=True)]

    def backward(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Positions in the template head of points of the deformed head, in mm."""
        if self.field is not None:
            points = integrate(self.field, points, self.n_steps, "rk4", inverse=True).detach()
        return points / self.sizes


def random_warp(meshes: list[Mesh], size_sd: float, warp_mm: tuple[float, ...], generator: Generator) -> HeadWarp:
    """A random deformation of a head that contains the meshes."""
    # The steps of the flow (Runge–Kutta of order four) are short enough that each is injective: h·L ≤ ½ for the bound L
    # of the Lipschitz constant, and a step reduces no distance by more than the factor 2 − e^(h·L) > 0. Triangles
    # between moving vertices may intersect where surfaces nearly touch.
    rng = numpy_generator(generator)
    sizes = random_sizes(size_sd, rng)
    if not warp_mm:
        return HeadWarp(sizes, None)
    field = random_velocity(*(mesh.vertices * sizes for mesh in meshes), warp_mm=warp_mm, generator=rng)
    steepness = float(field.lipschitz_bound())
    if steepness > STEEPEST:
        raise ValueError(
            f"warp_mm = {warp_mm} gives a velocity with Lipschitz bound {steepness:.3g}; at most {STEEPEST:g} is "
            "allowed: make the warp weaker, first at its finest scale"
        )
    return HeadWarp(sizes, field, max(1, math.ceil(2 * steepness)))


def smooth_variation(
    points: Float[Tensor, "n 3"], length: float, generator: Generator, n_fields: int = 1
) -> Float[Tensor, "n k"]:
    """Smooth random fields at the points, each with mean 0 and standard deviation 1 in space, clipped to ± 2.5."""
    if not length > 0 or n_fields not in (1, 2, 3):
        raise ValueError(f"length is {length!r} and n_fields {n_fields!r}; a length > 0 and 1, 2 or 3 are needed")
    rng = numpy_generator(generator)
    lower = torch.floor(points.amin(dim=0) / length) - 1
    n_nodes = [int(n) for n in torch.ceil(points.amax(dim=0) / length) - lower + 3]
    coefficients = torch.from_numpy(rng.standard_normal((*n_nodes, 3))).to(points) / SPREAD
    values = spline_values(coefficients, points / length - lower)[:, :n_fields]
    return values.clamp(-LARGEST, LARGEST)


def random_sizes(size_sd: float, generator: Generator) -> Float[Tensor, " 3"]:
    """Random factors along x, y and z whose logarithms have standard deviation ``size_sd``."""
    return torch.from_numpy(np.exp(size_sd * numpy_generator(generator).standard_normal(3)))


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
class Shape(Settings):
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

    Raises
    ------
    ValueError
        If the mean subject of this shape has intersecting surfaces.
    """
    child = int(numpy_generator(seed).integers(2**62))
    for strength in STRENGTHS:
        rng = np.random.default_rng(child)
        # White surface, pial surface and wall of each side, before the warp.
        folding, thickness, atrophy = (
            mean + strength * sd * float(np.clip(rng.standard_normal(), -2, 2))
            for mean, sd in (
                (shape.folding, shape.folding_sd),
                (shape.thickness, shape.thickness_sd),
                (shape.atrophy, shape.atrophy_sd),
            )
        )
        atrophy, variation, cortices = max(atrophy, 0.0), strength * shape.thickness_variation, []
        for side in HEMISPHERES:
            if shape.kind == "procedural":
                part = procedural_cortex(side, shape.subdivisions, folding, thickness, variation, atrophy, rng)
            else:
                fields = smooth_variation(fsaverage5_surface("white", side).vertices, VARIATION_MM, rng, 2)
                depth = folding * (1 + strength * shape.folding_variation * fields[:, 0])
                scale = thickness / template_thickness() * (1 + variation * fields[:, 1])
                part = template_cortex(side, shape.subdivisions, depth, scale, atrophy)
            cortices.append(part)
        if shape.mirrored:  # x is reversed, and so is the order of the corners of every face
            flip = torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64)
            turned = [[Mesh(m.vertices * flip, m.faces.flip(1)) for m in part[:2]] for part in reversed(cortices)]
            cortices = [(*pair, part[2]) for pair, part in zip(turned, reversed(cortices), strict=True)]
        meshes = [mesh for white, pial, _ in cortices for mesh in (white, pial)]
        warp = random_warp(meshes, strength * shape.size_sd, tuple(strength * size for size in shape.warp_mm), rng)
        apart = kept_apart(warp.of_meshes(meshes))
        if apart is not None:
            walls = dict(zip(HEMISPHERES, (wall for _, _, wall in cortices), strict=True))
            white, pial = (dict(zip(HEMISPHERES, apart[first::2], strict=True)) for first in (0, 1))
            return CorticalSurfaces(white, pial, walls, strength, warp)
    raise ValueError(f"the surfaces of {shape} cross even without variation; lower folding, thickness or atrophy")


def mean_surfaces(shape: Shape | None = None) -> CorticalSurfaces:
    """The mean subject of a shape, without its variation; by default the refined fsaverage5 surfaces."""
    shape = Shape(folding=1.0, thickness=template_thickness()) if shape is None else shape
    return synthetic_subject(dataclasses.replace(shape.without_variation(), kind="template"), 0)


# Procedural folded hemispheres: sulci along the zeros of random noise on a smooth body, not derived from a brain.

LATERAL, MEDIAL, LENGTH, HEIGHT = 53.0, 15.0, 83.0, 57.0  # half-axes of the hull in mm; medial: towards the midline
_DEPTH = 16.0  # mm of the sulci, where folding is 1
_MEDIAL_DEPTH = 0.55  # factor on the depth towards the other hemisphere, where the body is thin
_DEEPEST = 21.0  # mm
WAVELENGTH = 22.0  # mm; zeros of the noise, and therefore sulci, are about half a wavelength apart
_BANDWIDTH = 0.18  # of the wave number
_SULCUS = 0.7  # approximately the sine of the phase at which a wall has half its height
_BLUNT = 0.3  # keeps the phase smooth where noise and gradient are both close to zero
_WALL_SMOOTHINGS = 8  # smoothing steps of the white surface, which make the steepest walls less steep
_PIAL_SMOOTHINGS = 2  # smoothing steps of the pial surface, for walls that meet in a slit
_SPACING = 3.0  # mm between the samples of the noise
_SPREADING = 25  # rounds of moving vertices to where the surface is large
_LARGEST_GROWTH = 6.0
_WALL_GAP = 0.3  # mm; the flow to the pial surface is not exactly normal, so that .1 mm would be too small
_PIAL_APART = 1.5  # smallest distance in mm between the midline and the pial surface


def procedural_cortex(
    side: Hemisphere,
    subdivisions: int,
    folding: float,
    thickness: float,
    thickness_variation: float,
    atrophy: float,
    generator: Generator,
) -> tuple[Mesh, Mesh, Bool[Tensor, " V"]]:
    """White surface, pial surface and medial wall of one hemisphere."""
    # The white surface is a sphere mapped to a body whose half-axes are smaller where the noise is near zero. Bodies of
    # different depths are nested, so the surface does not intersect itself. Vertices are redistributed so that faces
    # have similar areas. The surface is moved inwards by ``atrophy``. The pial surface is the white one offset outwards
    # by the thickness, or by less where a sulcus is too narrow.
    rng = numpy_generator(generator)
    # Noise with wavelengths around WAVELENGTH and its gradient, as splines, and the position of the first node.
    lower = -np.array([LATERAL + MEDIAL + 16, LENGTH + 10, HEIGHT + 10])
    shape = np.ceil(-2 * lower / _SPACING).astype(int)
    waves = np.fft.fftn(rng.standard_normal(tuple(shape)))
    frequencies = np.meshgrid(*[np.fft.fftfreq(n, _SPACING) for n in shape], indexing="ij")
    numbers = WAVELENGTH * np.sqrt(sum(f**2 for f in frequencies))
    waves *= np.exp(-(((numbers - 1) / _BANDWIDTH) ** 2) / 2)
    waves /= np.fft.ifftn(waves).real.std()
    band = np.fft.ifftn(waves).real
    slopes = [np.fft.ifftn(2j * np.pi * f * waves).real for f in frequencies]
    splines = [torch.from_numpy(np.stack(parts, axis=-1)) for parts in ([band] * 3, slopes)]
    body = _Body(side, min(folding * _DEPTH, _DEEPEST), (tuple(splines), torch.from_numpy(lower)))
    sphere = icosphere(subdivisions)
    # Directions that are denser where the surface is larger: each moves to the area-weighted mean of its faces.
    directions, faces = sphere.vertices, sphere.faces
    for _ in range(_SPREADING):
        areas = face_areas(sphere.with_vertices(body.surface(directions)))
        growth = (areas / areas.mean()).clamp(max=_LARGEST_GROWTH)
        centres = (growth[:, None] * directions[faces].mean(dim=1)).repeat_interleave(3, dim=0)
        sums = torch.zeros_like(directions).index_add(0, faces.flatten(), centres)
        directions = sums / torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    outside = 1 - body.wall(directions)
    white = laplacian_smoothing(sphere.with_vertices(body.surface(directions)), _WALL_SMOOTHINGS)
    white = offset_surface(white, torch.full_like(outside, -atrophy))
    varied = 1 + thickness_variation * smooth_variation(white.vertices, VARIATION_MM, rng)[:, 0]
    pial = offset_surface(white, (thickness * varied * outside).clamp(min=_WALL_GAP))
    pial = laplacian_smoothing(pial, _PIAL_SMOOTHINGS)
    return white, pial, thickness * outside < WALL_THICKNESS


class _Body:
    """The map from directions on the unit sphere to positions in mm."""

    def __init__(self, side: Hemisphere, depth: float, noise: tuple[tuple[Tensor, Tensor], Tensor]):
        self.outwards = -1.0 if side == "left" else 1.0
        self.depth, (self.noise, self.lower) = depth, noise

    def surface(self, directions: Float[Tensor, "V 3"]) -> Float[Tensor, "V 3"]:
        """The white surface, in mm."""
        middle = self._layer(directions, torch.full_like(directions[:, 0], 0.4 * self.depth))
        values, slopes = (spline_values(field, (middle - self.lower) / _SPACING) for field in self.noise)
        squared = values[:, 0].square()
        # Similar to sin²(2π d/λ) at distance d from a zero, so that all sulci have about the same width.
        phase = squared / (squared + slopes.square().sum(dim=1) * (WAVELENGTH / (2 * np.pi)) ** 2 + _BLUNT)
        height = (1 + _SULCUS**2) * phase / (phase + _SULCUS**2)
        wall = self.wall(directions)
        return self._layer(directions, self.depth * (1 - torch.lerp(height, torch.full_like(height, 0.5), wall)))

    def wall(self, directions: Float[Tensor, "V 3"]) -> Float[Tensor, " V"]:
        """0 where there are folds and cortex, increasing to 1 in the centre of the medial wall."""
        x, y, z = (directions * directions.new_tensor([-self.outwards, LENGTH, HEIGHT])).unbind(dim=1)
        ellipse = ((y + 5) / 34) ** 2 + ((z + 4) / 20) ** 2
        return (3 * x).clamp(0, 1) * torch.exp(-ellipse.square())

    def _layer(self, directions: Float[Tensor, "V 3"], inset: Float[Tensor, " V"]) -> Float[Tensor, "V 3"]:
        x, y, z = directions.unbind(dim=1)
        across = torch.where(self.outwards * x > 0, LATERAL - inset, MEDIAL - _MEDIAL_DEPTH * inset)
        midline = self.outwards * (MEDIAL + _PIAL_APART + 3.0)
        return torch.stack([across * x + midline, (LENGTH - inset) * y, (HEIGHT - inset) * z], dim=1)


# Cortical surfaces made from fsaverage5 with deeper or shallower folds and another cortical thickness.

SUBDIVISIONS = 5  # of fsaverage5
_FOLD_SMOOTHINGS = 40  # enough to remove gyri and keep lobes
_WHITE_APART = 1.0  # mm by which each hemisphere is moved away from the midline, where those of fsaverage5 overlap
#: Distance in mm between the white and pial surfaces on the medial wall. In fsaverage5 they coincide there.
WALL_GAP = 0.1
#: Vertices of the template where the cortex is thinner than this, in mm, belong to the medial wall.
WALL_THICKNESS = 0.5


def template_cortex(
    side: Hemisphere, subdivisions: int, folding: Float[Tensor, " n"], thickness: Float[Tensor, " n"], atrophy: float
) -> tuple[Mesh, Mesh, Bool[Tensor, " V"]]:
    """White surface, pial surface and medial wall of one hemisphere, made from fsaverage5 with modified folds."""
    # Let S be the white surface W after smoothing that removes its folds, and let α be the depth of folds. The new
    # white surface is S + α (W − S), moved inwards by ``atrophy``. The vectors P − W to the pial surface P are scaled
    # by s. On the medial wall the surfaces are kept .1 mm apart. Folds are changed on the vertices of fsaverage5. The
    # result is then refined smoothly.
    white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    smooth = laplacian_smoothing(white, _FOLD_SMOOTHINGS).vertices
    shift = torch.tensor([-_WHITE_APART if side == "left" else _WHITE_APART, 0.0, 0.0], dtype=torch.float64)
    folded = white.with_vertices(smooth + folding[:, None] * (white.vertices - smooth) + shift)
    cortex = pial.vertices - white.vertices
    rounds = subdivisions - SUBDIVISIONS
    surface = smoothly_refined(folded, rounds)
    # Refinement is linear and can therefore be applied to the vectors through the cortex as to the vertices.
    thinnest = safe_norm(smoothly_refined(white.with_vertices(cortex), rounds).vertices)
    cortex = smoothly_refined(white.with_vertices(thickness[:, None] * cortex), rounds).vertices
    surface = offset_surface(surface, torch.full_like(thinnest, -atrophy))
    # The white surface plus the vectors through the cortex, at least WALL_GAP along the normal.
    normals = vertex_normals(surface)
    missing = (WALL_GAP - (cortex * normals).sum(dim=1)).clamp(min=0)
    pial = surface.with_vertices(surface.vertices + cortex + missing[:, None] * normals)
    return surface, pial, thinnest < WALL_THICKNESS


def template_thickness() -> float:
    """The median distance in mm between corresponding vertices of fsaverage5's surfaces, without medial walls."""
    distances = [
        safe_norm(fsaverage5_surface("pial", side).vertices - fsaverage5_surface("white", side).vertices)
        for side in ("left", "right")
    ]
    together = torch.cat(distances)
    return float(together[together >= WALL_THICKNESS].median())


# Offset surfaces: a surface moved outwards or inwards by some mm, without self-intersection where walls would meet.

_VOXEL = 1.0  # mm
_BLUR = 1.3  # mm
_FLAT = 0.02  # per mm: below this slope the blurred edge has no reliable direction
_STEP = 0.25  # mm
_MARGIN = 4.0  # mm, beyond the largest distance


def offset_surface(mesh: Mesh, distances: Float[Tensor, " V"]) -> Mesh:
    """Move every vertex of a closed surface outwards by a distance in mm (inwards if negative), as far as possible."""
    # The vertices follow the flow of one smooth velocity field: the negative gradient of the enclosed volume's
    # indicator function, blurred by 1.3 mm, scaled to unit speed. Where walls face each other, the gradient vanishes
    # and the velocity is lower. Trajectories do not meet, so that the walls of a sulcus approach each other and stop. A
    # vertex stops when its distance from the start is the requested one, or after twice the time for the largest
    # distance.
    if len(distances) != len(mesh.vertices) or float(distances.min()) * float(distances.max()) < 0:
        raise ValueError(
            f"{len(distances)} distances from {float(distances.min()):.3g} to {float(distances.max()):.3g} mm for "
            f"{len(mesh.vertices)} vertices; one for each, all of one sign, is needed"
        )
    if float(signed_volume(mesh)) <= 0:
        raise ValueError("the mesh encloses a negative volume: its normals point inward; flip its faces")
    farthest = float(distances.abs().max())
    if farthest == 0:
        return mesh
    # Spline coefficients of the velocity on a grid around the mesh, whose first node is at ``lower``.
    vertices, margin = mesh.vertices.detach(), farthest + _MARGIN
    lower = torch.floor(vertices.amin(dim=0) - margin)
    shape = [int(n) for n in torch.ceil((vertices.amax(dim=0) + margin - lower) / _VOXEL)]
    affine = np.diag([_VOXEL, _VOXEL, _VOXEL, 1.0])
    affine[:3, 3] = lower.numpy()
    # Deep folds may intersect and have regions with winding number -1, which count as outside.
    inside = winding_numbers(mesh, Volume(np.zeros(shape, dtype=np.float32), affine), n_lines=2).clip(0, 1)
    orders = np.eye(3, dtype=int).tolist()
    downhill = np.stack([-scipy.ndimage.gaussian_filter(inside, _BLUR / _VOXEL, order=o) for o in orders], axis=-1)
    downhill /= _VOXEL
    speed = np.linalg.norm(downhill, axis=-1, keepdims=True)
    coefficients = torch.from_numpy(downhill / (speed + _FLAT)).to(vertices)
    step = _STEP if float(distances.sum()) > 0 else -_STEP

    def velocity(points: Tensor) -> Tensor:
        return spline_values(coefficients, (points - lower) / _VOXEL)

    start, wanted = mesh.vertices, distances.abs()
    place, reached = start, torch.zeros_like(wanted)
    result = start
    for _ in range(int(np.ceil(2 * farthest / _STEP))):
        following = place + step * velocity(place + step / 2 * velocity(place))
        reaches = safe_norm(following - start)
        part = ((wanted - reached) / (reaches - reached).clamp(min=1e-9)).clamp(0, 1)
        moving = reached < wanted  # the other vertices have stopped
        result = torch.where(moving[:, None], place + part[:, None] * (following - place), result)
        reached = torch.where(moving, torch.maximum(reaches, reached), reached)
        place = torch.where(moving[:, None], following, place)
    return mesh.with_vertices(result)


# Removal of self-intersections, and of intersections between surfaces of one head.

#: Vertices are rounded to multiples of 2⁻¹³ mm. Single precision represents them exactly, and the last bits of sums,
#: which differ between CPUs, are removed.
LATTICE = 2.0**-13
_REACH = 4.0  # mm around intersecting faces
_ROUNDS = 5
_CROSSING_SMOOTHINGS = 60


def on_lattice(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """The points rounded to multiples of 2⁻¹³ mm (.00012 mm)."""
    return (points / LATTICE).round() * LATTICE


def crossing_faces(meshes: list[Mesh]) -> Int64[Tensor, " n"]:
    """The faces that intersect another face of the same or another mesh, as indices into the joined meshes."""
    # If there are none, and the meshes are closed, any two of them are nested or disjoint.
    return self_intersecting_faces(united(meshes))


def kept_apart(meshes: list[Mesh]) -> list[Mesh] | None:
    """The meshes rounded to multiples of 2⁻¹³ mm, and smoothed near intersecting faces until no faces intersect."""
    # Each round smooths and checks only the neighbourhood of intersecting faces, and then checks all meshes again.
    whole = united(meshes)
    whole = whole.with_vertices(on_lattice(whole.vertices))
    for _ in range(_ROUNDS):
        crossing = self_intersecting_faces(whole)
        if not len(crossing):
            parts = whole.vertices.split([len(mesh.vertices) for mesh in meshes])
            return [mesh.with_vertices(part) for mesh, part in zip(meshes, parts, strict=True)]
        try:
            points = whole.vertices.numpy()
            tree = scipy.spatial.cKDTree(points[np.unique(whole.faces[crossing].numpy())])
            near = torch.from_numpy(tree.query(points, distance_upper_bound=_REACH)[0] < _REACH)
            used, faces = torch.unique(whole.faces[near[whole.faces].any(dim=1)], return_inverse=True)
            part = smooth_crossings(Mesh(whole.vertices[used], faces), _CROSSING_SMOOTHINGS)
            vertices = whole.vertices.clone()
            vertices[used] = on_lattice(part.vertices)
            whole = whole.with_vertices(vertices)
        except ValueError:  # smoothing failed
            return None
    return None


# Smooth refinement of triangle meshes by Loop subdivision.

WARREN = 3 / 8  # fraction of the way to the mean of the neighbours for old vertices with more than three neighbours


def loop_subdivided(mesh: Mesh) -> Mesh:
    """A closed mesh after one step of Loop subdivision (with Warren's weights): four faces for each face.

    Repeated steps converge to a surface with continuous normals, and curvature almost everywhere. Subdivision at the
    midpoints alone would keep flat faces. The mesh shrinks slightly. Old vertices keep their indices; new ones follow.

    References
    ----------
    Loop, *Smooth subdivision surfaces based on triangles*, 1987; Warren, *Subdivision methods for geometric design*,
    1995.
    """
    n_vertices, n_faces = len(mesh.vertices), len(mesh.faces)
    points, faces = split_in_four(mesh.vertices, mesh.faces)
    # The four parts of a triangle contain the midpoints of its sides; the corner opposite to a side has weight 1/8.
    midpoints = torch.cat([faces[:n_faces, 1], faces[n_faces : 2 * n_faces, 2], faces[:n_faces, 2]])
    across = mesh.vertices[mesh.faces.roll(-2, dims=1).T.flatten()]
    smoothed = torch.cat([_smoothed(mesh), 3 / 4 * points[n_vertices:]])
    return Mesh(smoothed.index_add(0, midpoints, across / 8), faces)


def smoothly_refined(mesh: Mesh, n_rounds: int = 1, n_corrections: int = 3) -> Mesh:
    """Loop subdivision of a closed mesh whose vertices are first moved outwards to compensate for the shrinkage."""
    for _ in range(n_rounds):
        sharpened = mesh
        for _ in range(n_corrections):
            missing = mesh.vertices - _smoothed(sharpened)
            sharpened = sharpened.with_vertices(sharpened.vertices + missing)
        mesh = loop_subdivided(sharpened)
    return mesh


def _smoothed(mesh: Mesh) -> torch.Tensor:
    return torch.lerp(mesh.vertices, neighbour_means(mesh), WARREN)
