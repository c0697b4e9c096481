"""Cortical surfaces made from fsaverage5 with deeper or shallower folds and another cortical thickness."""

import torch

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.mesh import Mesh
from meshot.mesh.editing import laplacian_smoothing
from meshot.mesh.geometry import safe_norm, vertex_normals
from meshot.synth.offset import offset_surface
from meshot.synth.refinement import smoothly_refined
from meshot.types import Bool, Float, Tensor

SUBDIVISIONS = 5  # of fsaverage5
_SMOOTHINGS = 40  # enough to remove gyri and keep lobes
_APART = 1.0  # mm by which each hemisphere is moved away from the midline, where those of fsaverage5 overlap
#: Distance in mm between the white and pial surfaces on the medial wall. In fsaverage5 they coincide there.
WALL_GAP = 0.1
#: Vertices of the template where the cortex is thinner than this, in mm, belong to the medial wall.
WALL_THICKNESS = 0.5


def template_cortex(
    side: Hemisphere, subdivisions: int, folding: Float[Tensor, " n"], thickness: Float[Tensor, " n"], atrophy: float
) -> tuple[Mesh, Mesh, Bool[Tensor, " V"]]:
    """White surface, pial surface and medial wall of one hemisphere, made from fsaverage5 with modified folds.

    Let S be the white surface W after smoothing that removes its folds, and let α be the depth of folds. The new white
    surface is S + α (W − S), moved inwards by ``atrophy``. The vectors P − W to the pial surface P are scaled by s. On
    the medial wall the surfaces are kept .1 mm apart. Folds are changed on the vertices of fsaverage5. The result is
    then refined smoothly.

    Parameters
    ----------
    side : "left" or "right"
    subdivisions : int
        With 5 the vertices are those of fsaverage5. Each further subdivision multiplies the number of faces by four.
    folding, thickness : tensor
        α and s for each vertex of fsaverage5, or one value for all.
    atrophy : float
        Distance by which the white surface is moved inwards, in mm.
    """
    white, pial = (fsaverage5_surface(kind, side) for kind in ("white", "pial"))
    smooth = laplacian_smoothing(white, _SMOOTHINGS).vertices
    shift = torch.tensor([-_APART if side == "left" else _APART, 0.0, 0.0], dtype=torch.float64)
    folded = white.with_vertices(smooth + folding[:, None] * (white.vertices - smooth) + shift)
    cortex = pial.vertices - white.vertices
    rounds = subdivisions - SUBDIVISIONS
    surface = smoothly_refined(folded, rounds)
    # Refinement is linear and can therefore be applied to the vectors through the cortex as to the vertices.
    thinnest = safe_norm(smoothly_refined(white.with_vertices(cortex), rounds).vertices)
    cortex = smoothly_refined(white.with_vertices(thickness[:, None] * cortex), rounds).vertices
    surface = offset_surface(surface, torch.full_like(thinnest, -atrophy))
    return surface, _lifted(surface, cortex), thinnest < WALL_THICKNESS


def _lifted(white: Mesh, cortex: Float[Tensor, "V 3"]) -> Mesh:
    """The white surface plus the vectors through the cortex, at least ``WALL_GAP`` along the normal."""
    normals = vertex_normals(white)
    missing = (WALL_GAP - (cortex * normals).sum(dim=1)).clamp(min=0)
    return white.with_vertices(white.vertices + cortex + missing[:, None] * normals)


def template_thickness() -> float:
    """The median distance in mm between corresponding vertices of fsaverage5's surfaces, without medial walls."""
    distances = [
        safe_norm(fsaverage5_surface("pial", side).vertices - fsaverage5_surface("white", side).vertices)
        for side in ("left", "right")
    ]
    together = torch.cat(distances)
    return float(together[together >= WALL_THICKNESS].median())
