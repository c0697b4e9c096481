"""What every measure offers to a loss: a third kind needs no change there."""

from typing import Protocol, runtime_checkable

from meshot.types import Float, Int64, Tensor


@runtime_checkable
class Measure(Protocol):
    """A probability measure as the losses read it: points, or mass spread evenly over triangles or segments.

    :class:`meshot.DiscreteMeasure` and :class:`meshot.SurfaceMeasure` are two. Any other class with these three
    attributes is taken by every loss that takes theirs; it is trusted to be valid, as those two check themselves.
    """

    @property
    def places(self) -> Float[Tensor, "n d"]:
        """What a direction projects, in units of the vertices; the supports, or the corners of the cells."""
        ...

    @property
    def weights(self) -> Float[Tensor, " k"]:
        """The masses of the cells, or of the points where there are no cells; at least zero, with sum one."""
        ...

    @property
    def cells(self) -> Int64[Tensor, "k corners"] | None:
        """Which places are the corners of each triangle (three) or segment (two); None for a measure of points."""
        ...
