"""Procedural folded hemispheres: sulci along the zeros of random noise on a smooth body, not derived from a brain."""

import numpy as np
import torch

from meshot.anatomy import Hemisphere
from meshot.flow.fields import spline_values
from meshot.mesh import Mesh
from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.geometry import face_areas
from meshot.mesh.shapes import icosphere
from meshot.rng import Generator, numpy_generator
from meshot.synth.folding import WALL_THICKNESS
from meshot.synth.offset import offset_surface
from meshot.synth.warp import VARIATION_MM, smooth_variation
from meshot.types import Bool, Float, Tensor

LATERAL, MEDIAL, LENGTH, HEIGHT = 53.0, 15.0, 83.0, 57.0  # half-axes of the hull in mm; medial: towards the midline
_DEPTH = 16.0  # mm of the sulci, where folding is 1
_MEDIAL_DEPTH = 0.55  # factor on the depth towards the other hemisphere, where the body is thin
_DEEPEST = 21.0  # mm
WAVELENGTH = 22.0  # mm; zeros of the noise, and therefore sulci, are about half a wavelength apart
_BANDWIDTH = 0.18  # of the wave number
_SULCUS = 0.7  # approximately the sine of the phase at which a wall has half its height
_BLUNT = 0.3  # keeps the phase smooth where noise and gradient are both close to zero
_SMOOTHINGS = 8  # smoothing steps of the white surface, which make the steepest walls less steep
_PIAL_SMOOTHINGS = 2  # smoothing steps of the pial surface, for walls that meet in a slit
_SPACING = 3.0  # mm between the samples of the noise
_SPREADING = 25  # rounds of moving vertices to where the surface is large
_LARGEST_GROWTH = 6.0
_WALL_GAP = 0.3  # mm; the flow to the pial surface is not exactly normal, so that .1 mm would be too small
_APART = 1.5  # smallest distance in mm between the midline and the pial surface


def procedural_cortex(
    side: Hemisphere,
    subdivisions: int,
    folding: float,
    thickness: float,
    thickness_variation: float,
    atrophy: float,
    generator: Generator,
) -> tuple[Mesh, Mesh, Bool[Tensor, " V"]]:
    """White surface, pial surface and medial wall of one hemisphere.

    The white surface is a sphere mapped to a body whose half-axes are smaller where the noise is near zero. Bodies of
    different depths are nested, so the surface does not intersect itself. Vertices are redistributed so that faces have
    similar areas. The surface is moved inwards by ``atrophy``. The pial surface is the white one offset outwards by the
    thickness, or by less where a sulcus is too narrow.

    Parameters
    ----------
    side : "left" or "right"
    subdivisions : int
        Number of subdivisions of an icosahedron.
    folding : float
        Depth of the sulci, where 1 means 16 mm.
    thickness, thickness_variation : float
        Thickness of the cortex in mm, and its relative standard deviation over the surface.
    atrophy : float
        In mm.
    generator : generator or int
    """
    rng = numpy_generator(generator)
    body = _Body(side, min(folding * _DEPTH, _DEEPEST), _noise(rng))
    sphere = icosphere(subdivisions)
    directions = _spread(sphere, body)
    outside = 1 - body.wall(directions)
    white = laplacian_smoothing(sphere.with_vertices(body.surface(directions)), _SMOOTHINGS)
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
        midline = self.outwards * (MEDIAL + _APART + 3.0)
        return torch.stack([across * x + midline, (LENGTH - inset) * y, (HEIGHT - inset) * z], dim=1)


def _noise(rng: np.random.Generator) -> tuple[tuple[Tensor, Tensor], Float[Tensor, " 3"]]:
    """Noise with wavelengths around ``WAVELENGTH`` and its gradient, as splines, and the position of the first node."""
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
    return tuple(splines), torch.from_numpy(lower)


def _spread(sphere: Mesh, body: _Body) -> Float[Tensor, "V 3"]:
    """Directions that are denser where the surface is larger: each moves to the area-weighted mean of its faces."""
    directions, faces = sphere.vertices, sphere.faces
    for _ in range(_SPREADING):
        areas = face_areas(sphere.with_vertices(body.surface(directions)))
        growth = (areas / areas.mean()).clamp(max=_LARGEST_GROWTH)
        centres = (growth[:, None] * directions[faces].mean(dim=1)).repeat_interleave(3, dim=0)
        sums = torch.zeros_like(directions).index_add(0, faces.flatten(), centres)
        directions = sums / torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    return directions
