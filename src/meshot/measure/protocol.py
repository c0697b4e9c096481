"""The interface between measures and losses."""

from typing import Protocol, runtime_checkable

from meshot.types import Float, Int64, Tensor


@runtime_checkable
class Measure(Protocol):
    """A probability measure as the losses use it: weighted points, or mass distributed over triangles or segments.

    :class:`meshot.DiscreteMeasure` and :class:`meshot.SurfaceMeasure` follow this protocol. Every loss that accepts
    them accepts any other class with these three attributes. Such a class is not validated.
    """

    @property
    def places(self) -> Float[Tensor, "n d"]:
        """The positions that are projected, in units of the vertices: support points, or corners of the cells."""
        ...

    @property
    def weights(self) -> Float[Tensor, " k"]:
        """The masses of the cells, or of the points if there are no cells. Non-negative, with sum one."""
        ...

    @property
    def cells(self) -> Int64[Tensor, "k corners"] | None:
        """The indices of the corners of each triangle (three) or segment (two); None for a measure of points."""
        ...
