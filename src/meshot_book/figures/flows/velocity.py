"""What a velocity field looks like: a slice of the image with an arrow at every place of a grid."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from meshot.errors import require_choice, require_positive_integer
from meshot.flow import VelocityField
from meshot.mesh import Mesh, plane_section
from meshot.types import Array, Float, Tensor
from meshot.view import LINE_COLOURS, PLANES, WIDTH, slice_image
from meshot.volume import Volume


@torch.no_grad()
def velocities_on_slice(
    field: VelocityField, volume: Volume, plane: str, position_mm: float, n_arrows: int, like: Tensor
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Places of an even grid on a plane through a volume, and the velocity at time 0 there, in mm per unit of time."""
    require_positive_integer(n_arrows, "n_arrows")
    require_choice(plane, "plane", PLANES)
    axis, shown, _ = PLANES[plane]
    left, right, bottom, top = slice_image(volume, axis, position_mm)[1]
    spacing = max(right - left, top - bottom) / n_arrows
    across, along = (np.arange(low + spacing / 2, high, spacing) for low, high in ((left, right), (bottom, top)))
    points = np.full((len(along), len(across), 3), float(position_mm))
    points[..., shown[0]], points[..., shown[1]] = across, along[:, None]
    places = torch.from_numpy(points.reshape(-1, 3)).to(like)
    moves = field.prepared()(places.new_zeros(()), places)
    return places.double().cpu().numpy(), moves.double().cpu().numpy()


def velocity_figure(
    field: VelocityField,
    volume: Volume,
    plane: str,
    position_mm: float,
    meshes: Mapping[str, Mesh] | None = None,
    n_arrows: int = 36,
    magnification: float = 1.0,
    longest: float | None = None,
) -> Figure:
    """A slice with arrows: their direction and length are the velocity within the slice, their colour its whole speed.

    Parameters
    ----------
    field : VelocityField
    volume : Volume
    plane : str
        "axial", "coronal" or "sagittal".
    position_mm : float
        Where the plane is.
    n_arrows : int
        Along the longer side.
    meshes : mapping, optional
        Surfaces by name, drawn where they meet the slice; the arrows get the dtype of the first.
    magnification : float
        How many times longer arrows are drawn than the way that the velocity would lead.
    longest : float, optional
        The speed at the end of the colour bar, in mm per unit of time; the 99th percentile if left out.

    Raises
    ------
    ValueError
        If the plane has another name, ``n_arrows`` is not a positive integer, or ``magnification`` is not positive.
    """
    if not magnification > 0:
        raise ValueError(f"magnification is {magnification!r}; a number > 0 is needed")
    meshes = meshes or {}
    like = next((mesh.vertices for mesh in meshes.values()), torch.zeros(0))
    places, moves = velocities_on_slice(field, volume, plane, position_mm, n_arrows, like)
    axis, shown, _ = PLANES[plane]
    image, extent = slice_image(volume, axis, position_mm)
    speeds = np.linalg.norm(moves, axis=1)
    top = longest or max(float(np.quantile(speeds, 0.99)), 1e-12)
    ratio = (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure, ax = plt.subplots(figsize=(WIDTH, min(0.82 * WIDTH * ratio, 1.1 * WIDTH) + 0.8), layout="constrained")
    ax.imshow(image, extent=extent, origin="lower", cmap="gray", alpha=0.55)
    for (name, mesh), colour in zip(meshes.items(), LINE_COLOURS, strict=False):
        segments = plane_section(mesh, axis, position_mm)[:, :, list(shown)].detach().cpu().numpy()
        ax.add_collection(LineCollection(segments, colors=colour, linewidths=1.5, label=name), autolim=False)
    flat = magnification * moves[:, list(shown)]
    arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.003, "cmap": "viridis", "clim": (0, top)}
    drawn = ax.quiver(*places[:, list(shown)].T, *flat.T, speeds, **arrows)
    label = "speed (mm per unit of time)" + (f"; arrows × {magnification:g}" if magnification != 1 else "")
    figure.colorbar(drawn, ax=ax, label=label, location="bottom", shrink=0.7, aspect=35)
    ax.set(xlabel=f"{'xyz'[shown[0]]} (mm)", ylabel=f"{'xyz'[shown[1]]} (mm)", aspect="equal")
    if meshes:
        figure.legend(loc="outside upper center", ncols=len(meshes))
    return figure
