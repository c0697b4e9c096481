"""The kernel norm of the difference of two varifolds, the classic loss of surface matching."""

from typing import NamedTuple

from torch.utils.checkpoint import checkpoint

from meshot.errors import require_choice, require_positive
from meshot.loss.fused import takes_kernel
from meshot.loss.fused_pairs import fused_norm
from meshot.measure import Measure, as_point_measures
from meshot.types import Float, Tensor


class Angular(NamedTuple):
    """A kernel of two unit normals with the scalar product u: exp(−s (1 − u)) (c₀ + c₁ u + c₂ u²)."""

    sharpness: float
    constant: float
    linear: float
    square: float

    def of(self, u: Tensor) -> Tensor:
        """The values of the kernel."""
        return (self.sharpness * (u - 1)).exp() * (self.constant + u * (self.linear + u * self.square))


#: Kernels of two unit normals by name.
ANGULAR = {
    "currents": Angular(0.0, 0.0, 1.0, 0.0),
    "varifold": Angular(0.0, 0.0, 0.0, 1.0),
    "oriented": Angular(8.0, 1.0, 0.0, 0.0),
}
_BLOCK = 1 << 22  # pairs of points per block


def varifold_kernel(
    source: Measure, target: Measure, width: float = 5.0, angular: str = "oriented"
) -> Float[Tensor, ""]:
    """The squared kernel norm ‖μ − ν‖² of the difference of two varifolds.

    The inner product of two varifolds is Σᵢⱼ aᵢ bⱼ exp(−‖xᵢ − yⱼ‖²/w²) γ(mᵢ · nⱼ), with masses aᵢ and bⱼ, positions xᵢ
    and yⱼ, unit normals mᵢ and nⱼ, and the width w. The norm compares both surfaces within a distance of about w.
    Surfaces farther apart than a few widths do not attract each other.

    Parameters
    ----------
    source, target : measure
        Points in R⁶ with positive length of the last three coordinates: a position and a scaled normal, as
        :func:`meshot.varifold` makes them with ``normal_scale`` > 0. Only the direction of the normal counts.
    width : float
        The width w of the Gaussian in space, in units of the positions.
    angular : str
        The kernel γ of two normals: ``"currents"`` (u), in which opposite normals cancel; ``"varifold"`` (u²), which
        does not depend on orientation; ``"oriented"`` (exp(2 (u − 1)/σ²) with σ = ½), in which opposite normals neither
        cancel nor match.

    Returns
    -------
    tensor
        Without unit, since the masses sum to one: at most 4. It is zero between equal varifolds.

    Raises
    ------
    ValueError
        If the measures are not of points in R⁶, a normal has length zero, the width is not positive, or the kernel is
        unknown.

    Notes
    -----
    O(n m) time and O(n + m) memory. On a CPU, in float32 or float64, compiled kernels compute the value and the
    gradient. They leave out pairs whose Gaussian is below the rounding error of the dtype, which lie more than 4 widths
    apart in float32 and 6 in float64. Otherwise PyTorch computes blocks of pairs, twice for the gradient. The masses
    are normalised, in contrast to the cited papers, where they are areas.

    References
    ----------
    Charon and Trouvé, *The varifold representation of nonoriented shapes for diffeomorphic registration*, SIAM J.
    Imaging Sciences 2013; Kaltenmark, Charlier and Charon, *A general framework for curve and surface comparison and
    registration with oriented varifolds*, CVPR 2017.

    Examples
    --------
    >>> import torch, meshot
    >>> up = torch.tensor([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    >>> apart = up + torch.tensor([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    >>> from meshot.loss import varifold_kernel
    >>> found = varifold_kernel(meshot.DiscreteMeasure(up), meshot.DiscreteMeasure(apart), width=1.0)
    >>> round(float(found), 4)  # 2 (1 − 1/e)
    1.2642
    """
    source, target = as_point_measures(source, target)
    require_positive(width, "width", "units of the positions")
    require_choice(angular, "angular", ANGULAR)
    middle = target.places.detach()[:, :3].mean(dim=0)  # squared distances are more accurate near the origin
    first, second = (_oriented_points(m, middle / width, width) for m in (source, target))
    kernel = ANGULAR[angular]
    if takes_kernel(source.places):
        return fused_norm(first, second, kernel)
    own = sum(_inner(*side, *side, kernel) for side in (first, second))
    return own - 2 * _inner(*first, *second, kernel)


def _oriented_points(measure: Measure, middle: Tensor, width: float) -> tuple[Tensor, Tensor, Tensor]:
    """Positions in widths, unit normals, and masses."""
    if measure.places.shape[1] != 6:
        raise ValueError(
            f"the points lie in R^{measure.places.shape[1]}; R^6 is needed, a position and a normal: encode the mesh "
            "with varifold(mesh, normal_scale=1.0)"
        )
    positions, normals = measure.places[:, :3] / width - middle, measure.places[:, 3:]
    lengths = normals.norm(dim=1, keepdim=True)
    if not bool((lengths > 0).all()):
        raise ValueError(
            f"{int((lengths == 0).sum())} normals have length zero; positive lengths are needed: encode the mesh with "
            "varifold(mesh, normal_scale=1.0)"
        )
    return positions, normals / lengths, measure.weights


def _inner(x: Tensor, m: Tensor, a: Tensor, y: Tensor, n: Tensor, b: Tensor, kernel: Angular) -> Float[Tensor, ""]:
    """The inner product of two varifolds, block by block."""
    rows = max(1, _BLOCK // len(y))
    blocks = zip(x.split(rows), m.split(rows), a.split(rows), strict=True)
    return sum(checkpoint(_block, *block, y, n, b, kernel, use_reentrant=False) for block in blocks)


def _block(x: Tensor, m: Tensor, a: Tensor, y: Tensor, n: Tensor, b: Tensor, kernel: Angular) -> Float[Tensor, ""]:
    squared = x.square().sum(dim=1)[:, None] + y.square().sum(dim=1) - 2 * x @ y.T
    return a @ ((-squared).exp() * kernel.of(m @ n.T)) @ b
