"""The folds of fsaverage5, deepened or flattened, with a cortex of another thickness."""

import torch

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.mesh import Mesh
from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.geometry import safe_norm, vertex_normals
from meshot.synth.offset import offset_surface
from meshot.synth.refinement import smoothly_refined
from meshot.types import Bool, Float, Tensor

SUBDIVISIONS = 5  # of fsaverage5
_SMOOTHINGS = 40  # until gyri are gone and lobes are left
_APART = 1.0  # mm by which each hemisphere is moved from the midline, where fsaverage5's two overlap
#: How far the pial surface stays from the white one where there is no cortex, in mm; in fsaverage5 they coincide.
WALL_GAP = 0.1
#: Cortex of the template thinner than this, in mm, is medial wall.
WALL_THICKNESS = 0.5


def template_cortex(
    side: Hemisphere, subdivisions: int, folding: Float[Tensor, " n"], thickness: Float[Tensor, " n"], atrophy: float
) -> tuple[Mesh, Mesh, Bool[Tensor, " V"]]:
    """White surface, pial surface and medial wall of one hemisphere of fsaverage5 with other folds.

    With S the white surface W smoothed until its folds are gone, and α the depth of folds, the white surface becomes
    S + α (W − S), then recedes; the pial surface P becomes W + s (P − W), and stays .1 mm from the white one where
    there is no cortex. Folds are changed on fsaverage5's own vertices, which are then refined smoothly.

    Parameters
    ----------
    side : "left" or "right"
    subdivisions : int
        5 leaves the vertices of fsaverage5, each one more makes four times as many faces.
    folding, thickness : tensor
        α and s for each of fsaverage5's vertices, or one for all.
    atrophy : float
        How far the white surface recedes, in mm.
    """
    white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    smooth = laplacian_smoothing(white, _SMOOTHINGS).vertices
    shift = torch.tensor([-_APART if side == "left" else _APART, 0.0, 0.0], dtype=torch.float64)
    folded = white.with_vertices(smooth + folding[:, None] * (white.vertices - smooth) + shift)
    cortex = pial.vertices - white.vertices
    rounds = subdivisions - SUBDIVISIONS
    surface = smoothly_refined(folded, rounds)
    # Refinement is linear, and so may be done to the vectors through the cortex as to the vertices.
    thinnest = safe_norm(smoothly_refined(white.with_vertices(cortex), rounds).vertices)
    cortex = smoothly_refined(white.with_vertices(thickness[:, None] * cortex), rounds).vertices
    surface = offset_surface(surface, torch.full_like(thinnest, -atrophy))
    return surface, _lifted(surface, cortex), thinnest < WALL_THICKNESS


def _lifted(white: Mesh, cortex: Float[Tensor, "V 3"]) -> Mesh:
    """The white surface plus the vectors through the cortex, made to rise at least ``WALL_GAP``."""
    normals = vertex_normals(white)
    missing = (WALL_GAP - (cortex * normals).sum(dim=1)).clamp(min=0)
    return white.with_vertices(white.vertices + cortex + missing[:, None] * normals)


def template_thickness() -> float:
    """The median distance in mm between corresponding vertices of fsaverage5's surfaces, medial walls left out."""
    distances = [
        safe_norm(fsaverage5_surface("pial", side).vertices - fsaverage5_surface("white", side).vertices)
        for side in ("left", "right")
    ]
    together = torch.cat(distances)
    return float(together[together >= WALL_THICKNESS].median())
