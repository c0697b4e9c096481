"""Conversion between volumes and surfaces: voxelisation, signed distance, genus-0 correction, marching cubes.

A closed mesh is converted to a mask or a distance on a grid, a mask to one component of genus 0, and a field to a mesh.
Signed distances are negative inside. Lengths are in mm.
"""

import numpy as np
import scipy.ndimage
import torch

from meshot.errors import require_positive_integer
from meshot.extras import needing
from meshot.mesh import Mesh
from meshot.types import Array, Bool, Float, Int
from meshot.volume._kernel_surfaces import flood, nearest_in_band, spread_nearest
from meshot.volume.volume import Volume, mm_to_voxel, voxel_sizes, voxel_to_mm

# Voxelisation of closed meshes.


def enclosed_voxels(mesh: Mesh, grid: Volume) -> Bool[Array, "X Y Z"]:
    """Which voxel centres are inside a closed mesh, by the parity of intersections along the last axis of the grid."""
    column, height, _ = _crossings(_corners(mesh, grid), grid.data.shape)
    n_columns, depth = grid.data.shape[0] * grid.data.shape[1], grid.data.shape[2]
    if (np.bincount(column, minlength=n_columns) % 2).any():
        raise ValueError("a line crosses the mesh an odd number of times: it is not closed; close it first")
    above = np.clip(np.ceil(height).astype(np.int64), 0, depth)
    toggles = np.bincount(column * (depth + 1) + above, minlength=n_columns * (depth + 1)) % 2
    return (np.cumsum(toggles.reshape(*grid.data.shape[:2], depth + 1), axis=2)[:, :, :depth] % 2).astype(bool)


def enclosed_fractions(mesh: Mesh, grid: Volume, n_lines: int = 3) -> Float[Array, "X Y Z"]:
    """The fraction of every voxel that a closed mesh encloses, from 0 to 1: the partial volume.

    Lengths along the last axis are exact. Across it, ``n_lines`` × ``n_lines`` lines per voxel are averaged.

    Raises
    ------
    ValueError
        If the numbers of entries and exits of a line differ, so that the mesh is not closed; or if its normals point
        inwards.
    """
    numbers = winding_numbers(mesh, grid, n_lines)
    if numbers.min() < -1e-6:
        raise ValueError("the normals of the mesh point inwards; outward normals are needed: flip its faces")
    return np.clip(numbers, 0, 1)


def winding_numbers(mesh: Mesh, grid: Volume, n_lines: int = 3) -> Float[Array, "X Y Z"]:
    """The mean winding number of a closed mesh over every voxel: 1 inside, 0 outside.

    If the mesh intersects itself, there may be regions with -1 or 2. Lines as in
    :func:`meshot.volume.enclosed_fractions`.

    Raises
    ------
    ValueError
        If the numbers of entries and exits of a line differ, so that the mesh is not closed.
    """
    require_positive_integer(n_lines, "n_lines")
    nx, ny, depth = grid.data.shape
    # Voxel (i, j) contains the lines n_lines·i … n_lines·i + n_lines − 1, evenly spaced.
    corners = _corners(mesh, grid)
    corners[:, :, :2] = (corners[:, :, :2] + 0.5) * n_lines - 0.5
    line, height, entering = _crossings(corners, (nx * n_lines, ny * n_lines))
    entering *= np.sign(np.linalg.det(grid.affine[:3, :3]))  # a reflected grid reverses every face
    if np.bincount(line, weights=entering).any():
        raise ValueError("a line enters the mesh more or less often than it leaves: it is not closed; close it first")
    x, y = np.divmod(line, ny * n_lines)
    # An entry adds the rest of its voxel and all voxels above; an exit subtracts the same.
    place = np.clip(height + 0.5, 0, depth)
    voxel = np.floor(place).astype(np.int64)
    column = ((x // n_lines) * ny + y // n_lines) * (depth + 2) + voxel
    filled = place - voxel
    gains = np.bincount(column, weights=entering * (1 - filled), minlength=nx * ny * (depth + 2))
    gains += np.bincount(column + 1, weights=entering * filled, minlength=nx * ny * (depth + 2))
    return np.cumsum(gains.reshape(nx, ny, depth + 2), axis=2)[:, :, :depth] / n_lines**2


def _corners(mesh: Mesh, grid: Volume) -> Float[Array, "F 3 3"]:
    """The corners of every face in voxel indices, with a negligible shift."""
    # Without the shift, a line through a vertex or an edge could be counted twice or not at all.
    corners = mm_to_voxel(grid, mesh.vertices.detach().double().cpu()).numpy()
    return (corners + np.array([1.37e-7, 2.91e-7, 0.0]))[mesh.faces.cpu().numpy()]


def _crossings(corners: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """The intersections of faces with lines along the last axis: the flat index of the line, the height in voxels,
    and 1 where an upward line enters the mesh, -1 where it leaves."""
    low = np.clip(np.ceil(corners[:, :, :2].min(axis=1)).astype(np.int64), 0, None)
    high = np.minimum(np.floor(corners[:, :, :2].max(axis=1)).astype(np.int64), np.array(shape[:2]) - 1)
    extent = np.maximum(high - low + 1, 0)
    count = extent[:, 0] * extent[:, 1]
    face = np.repeat(np.arange(len(corners)), count)
    within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    x = low[face, 0] + within // extent[face, 1]
    y = low[face, 1] + within % extent[face, 1]
    a, b, c = (corners[face, i] for i in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    safe = np.where(twice_area == 0, 1, twice_area)
    v = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (y - a[:, 1])) / safe
    w = ((b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (x - a[:, 0]) * (b[:, 1] - a[:, 1])) / safe
    hit = (twice_area != 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    height = a[:, 2] + v * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return (x * shape[1] + y)[hit], height[hit], -np.sign(twice_area[hit])


def voxel_distance(mesh: Mesh, grid: Volume) -> Float[Array, "X Y Z"]:
    """Signed distance of every voxel centre from a closed mesh, in mm, negative inside, accurate to about a voxel.

    It is the distance to the nearest voxel centre on the other side, minus half a voxel. Axes must be orthogonal.

    Raises
    ------
    ValueError
        If the mesh is not closed.
    """
    inside = enclosed_voxels(mesh, grid)
    sizes = voxel_sizes(grid)
    outward = scipy.ndimage.distance_transform_edt(~inside, sampling=sizes)
    inward = scipy.ndimage.distance_transform_edt(inside, sampling=sizes)
    return np.where(inside, -(inward - sizes.mean() / 2), outward - sizes.mean() / 2)


# Signed distance, in mm, from a level set of a field, with subvoxel accuracy.

_BAND = 1.5  # in units of the largest voxel side
_ROUNDS = 1  # forward and backward sweep through the grid


def signed_distance(field: Volume, level: float = 0.5) -> Volume:
    """The distance of every voxel centre from the level set of a field, negative where the field is above the level.

    Parameters
    ----------
    field : Volume
        Larger inside: a probability, the enclosed fraction of each voxel, or a mask. Its axes must be orthogonal.
    level : float
        In the units of the field.

    Returns
    -------
    Volume
        float64, in mm; zero on :func:`meshot.volume.isosurface`.

    Raises
    ------
    ValueError
        If the axes are not orthogonal, or no voxel, or every voxel, is above the level.

    Notes
    -----
    Up to one and a half voxels, the distance to the triangles of that surface is exact. Further away, every voxel uses
    the nearest points of its neighbours (Danielsson's sweeps). The result is never too small, and at most .3 mm too
    large for voxels of 1.5 × 1.444 × 1.5 mm, .03 mm on average. Linear time; 2 s for the standard grid.

    The distance of the triangles from the true surface depends on the field. For spheres of 6 to 30 mm on that grid,
    over all voxels, enclosed fractions give errors below .6 mm, on average .1 mm for the smallest sphere and below
    .06 mm from 24 mm on. Masks, which contain no partial volumes, give errors below .8 mm, on average .2 to .3 mm. The
    tests check these numbers.
    """
    axes = field.affine[:3, :3] / voxel_sizes(field)
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-4:
        raise ValueError("the axes of the volume are not orthogonal, so that voxels are not boxes; resample it first")
    mesh, sizes = isosurface(field, level), voxel_sizes(field)
    corners = (mm_to_voxel(field, mesh.vertices).numpy() * sizes)[mesh.faces.numpy()]
    squared, foot = nearest_in_band(corners, sizes, field.data.shape, _BAND * sizes.max())
    spread_nearest(squared, foot, sizes, _ROUNDS)
    distance = np.sqrt(squared)
    return field.with_data(np.where(field.data > level, -distance, distance))


# Level sets of volumes as meshes, by marching cubes, in mm of scanner RAS.

with needing("cortex"):
    import skimage.measure


#: Voxels closer to the level than this part of the range of values equal it.
_LEVEL_APART = 1e-6


def isosurface(volume: Volume, level: float = 0.5) -> Mesh:
    """The closed level set of a volume, by marching cubes, with outward normals.

    The volume is padded by one voxel with its minimum, so that the surface is closed even if the object reaches the
    border. Voxels that equal the level are outside: marching cubes would leave holes there, so they are lowered by
    10⁻⁴ of the range of values. The vertices are transformed by the affine once. If the affine is a reflection, faces
    are reversed. The volume is a mask, or a field that is larger inside; the level is in its units. The mesh is in
    float64, in mm. Its topology is that of the voxels above the level if these are well-composed, see
    :func:`meshot.volume.genus_zero`.

    Raises
    ------
    ValueError
        If no voxel, or every voxel, is above the level.

    References
    ----------
    Lewiner et al., *Efficient Implementation of Marching Cubes' Cases with Topological Guarantees*, 2003.
    """
    data = volume.data.astype(np.float32)
    low, high = float(data.min()), float(data.max())
    if not low < level < high:
        raise ValueError(
            f"the volume ranges from {low:.4g} to {high:.4g}; the level ({level}) must lie strictly between"
        )
    apart = data - np.float64(level)
    near = np.abs(apart) < _LEVEL_APART * (high - low)
    if near.any():
        data[near] = level + np.where(apart[near] > 0, 1e-4, -1e-4) * (high - low)
    vertices, faces, _, _ = skimage.measure.marching_cubes(
        np.pad(data, 1, constant_values=low), level, gradient_direction="descent", allow_degenerate=False
    )
    vertices = voxel_to_mm(volume, torch.from_numpy(vertices.astype(np.float64) - 1))
    faces = torch.from_numpy(np.ascontiguousarray(faces, dtype=np.int64))
    return Mesh(vertices, faces if np.linalg.det(volume.affine) < 0 else faces.flip(1))


def separated_field(field: Volume, mask: Bool[Array, "X Y Z"], level: float = 0.5, margin: float = 0.05) -> Volume:
    """A field that is above a level exactly on a mask, and unchanged where field and mask already agree.

    Marching cubes of the result has the topology of the mask, and positions between voxels as in the field. Values on
    the wrong side are reflected at the level, which gives slits and bridges about one voxel wide.

    Parameters
    ----------
    field : Volume
    mask : array
        Boolean, of the shape of the field.
    level : float
        In the units of the field.
    margin : float
        Values closer than this to the level are moved away from it. Otherwise vertices close to voxel centres would
        give degenerate triangles.

    Raises
    ------
    ValueError
        If the mask has another shape than the field.
    """
    if mask.shape != field.data.shape:
        raise ValueError(f"mask has shape {mask.shape}; {field.data.shape} is needed, one value for each voxel")
    away = np.maximum(np.abs(field.data - level), margin)
    return field.with_data(np.where(mask, level + away, level - away))


# Operations on masks: largest component, filling of cavities, genus-0 correction.

_CORNERS = np.ones((3, 3, 3), dtype=bool)


def largest_component(mask: Bool[Array, "X Y Z"]) -> Bool[Array, "X Y Z"]:
    """The largest component of a mask, where voxels are connected by faces.

    Raises
    ------
    ValueError
        If the mask is empty.
    """
    labels, n_pieces = scipy.ndimage.label(_require_mask(mask))
    return labels == 1 + np.argmax(np.bincount(labels.ravel(), minlength=n_pieces + 1)[1:])


def filled_cavities(mask: Bool[Array, "X Y Z"]) -> Bool[Array, "X Y Z"]:
    """The mask together with all cavities: background that is not 26-connected to the outside."""
    return scipy.ndimage.binary_fill_holes(mask, structure=_CORNERS)


def genus_zero(
    mask: Bool[Array, "X Y Z"], priority: Float[Array, "X Y Z"], pieces: bool = True
) -> Bool[Array, "X Y Z"]:
    """A part of the mask with the topology of a ball: one component, no cavity, no handle, well-composed.

    A region grows from the voxel of highest priority, in the order of priority. A voxel is added if it is simple for
    (26, 6) connectivity (adding it changes no component, handle or cavity) and if object and background remain
    well-composed (no two voxels meet only in an edge or a corner). Handles are therefore cut where the priority is
    lowest. Marching cubes then gives a surface of Euler number 2 without non-manifold edges. Simple points alone would
    not ensure this.

    Growth voxel by voxel also leaves out parts that could stay. Where two fronts meet, a single voxel between them may
    not be simple, or touch the other front in an edge or a corner only. So every connected piece that was left out is
    then added as a whole, if that changes no component, handle or cavity and the result is well-composed. In the white
    matter of a hemisphere, nearly half of the voxels left out come back.

    Parameters
    ----------
    mask : array
        Boolean. Only voxels of the mask are kept. Fill cavities first; otherwise a channel to each is left open. Fill
        tunnels, too, where that is the smaller change: see :func:`meshot.volume.filled_tunnels`.
    priority : array
        Voxels with high values are added first: the probability of the tissue, or the depth inside the mask.
    pieces : bool
        Whether pieces that growth left out are added as a whole where that changes no topology.

    Returns
    -------
    array
        Boolean, a subset of the mask.

    Raises
    ------
    ValueError
        If the mask is empty, the shapes differ, or a priority is not finite.

    Notes
    -----
    O(n log n) time in the number of voxels of the mask; 1–3 s for a hemisphere at 1 mm.

    References
    ----------
    Bertrand and Malandain, *A new characterization of three-dimensional simple points*, 1994; Latecki, *3D
    well-composed pictures*, 1997.
    """
    mask, priority = np.pad(_require_mask(mask), 2), np.pad(_require_values(mask, priority, "priority"), 2)
    seed = np.unravel_index(np.argmin(np.where(mask, -priority, np.inf)), mask.shape)
    grown = flood(mask, -priority, np.array(seed, dtype=np.int64))
    whole = grown.copy()
    labels, _ = scipy.ndimage.label(mask & ~grown & pieces, _CORNERS)
    for number, box in enumerate(scipy.ndimage.find_objects(labels), 1):
        box = tuple(slice(part.start - 2, part.stop + 2) for part in box)
        larger = whole[box] | (labels[box] == number)
        if _is_well_composed(larger) and _components_and_euler(larger) == _components_and_euler(whole[box]):
            whole[box] = larger
    # Numbers around a piece do not prove that the whole is a ball; those of the whole do.
    found = whole if _components_and_euler(whole) == (1, 1, 1) and _is_well_composed(whole) else grown
    return found[2:-2, 2:-2, 2:-2]


def filled_tunnels(field: Volume, mask: Bool[Array, "X Y Z"], largest: float, level: float = 0.5) -> Array:
    """The mask with those tunnels filled that little has to be added for.

    A tunnel through an object disappears if it is filled, or if the ring around it is cut, which
    :func:`meshot.volume.genus_zero` does. The background is grown from outside here, with the topology of the outside
    of a ball, at low values of the field first. What it cannot reach are fillings, each a connected piece. A piece is
    added to the mask if its cost is at most ``largest``. Expensive pieces, such as the membrane in a ring of two gyri
    that touch, are left open. A hole in a thin sheet is cheap.

    Parameters
    ----------
    field : Volume
        Larger inside: the probability of the tissue.
    mask : array
        Boolean, on the grid of the field: where the field is above the level, and its cavities.
    largest : float
        The largest cost of a piece in mm³: the sum of level minus field over its voxels, times the volume of a voxel.
        At a level of 0.5 that is at most half of the volume of the piece.
    level : float
        In the units of the field.

    Raises
    ------
    ValueError
        If the mask is empty or has another shape than the field, or ``largest`` is not a number from 0 on.

    References
    ----------
    Kriegeskorte and Goebel, *An efficient algorithm for topologically correct segmentation of the cortical sheet in
    anatomical MR volumes*, NeuroImage 2001: fill or cut, whichever changes less.
    """
    if not largest >= 0:
        raise ValueError(f"largest is {largest!r}; a cost in mm³ is needed, 0 or more")
    priority = np.pad(-_require_values(mask, field.data, "field"), 2, mode="edge")
    solid = np.pad(_require_mask(mask), 2)
    left = ~solid & ~genus_zero(~solid, priority)
    # The background has the topology of a ball, too. So one rod of it, from the object to the border, is not reached.
    labels, n_pieces = scipy.ndimage.label(left, _CORNERS)
    inner = np.zeros_like(solid)
    inner[1:-1, 1:-1, 1:-1] = True
    cost = scipy.ndimage.sum_labels(level + priority, labels, np.arange(n_pieces + 1)) * voxel_sizes(field).prod()
    cheap = cost <= largest
    cheap[np.unique(labels[~inner])] = False  # with the background, which has the label 0
    return filled_cavities((solid | cheap[labels])[2:-2, 2:-2, 2:-2])


def _require_values(mask: Array, values: Array, name: str) -> Float[Array, "X Y Z"]:
    if values.shape != mask.shape or not np.isfinite(values).all():
        raise ValueError(
            f"{name} has shape {values.shape} or is not finite; finite values of shape {mask.shape} are needed"
        )
    return np.asarray(values, dtype=np.float64)


def _components_and_euler(mask: Bool[Array, "X Y Z"]) -> tuple[int, int, int]:
    """Components of object and background, and the Euler number of the union of the closed voxels: (1, 1, 1) of a ball.

    Around the mask is background. Voxels of the object are connected by faces, edges or corners.
    """
    padded = np.pad(mask, 1)
    euler = int(skimage.measure.euler_number(padded, connectivity=3))
    return scipy.ndimage.label(padded, _CORNERS)[1], scipy.ndimage.label(~padded)[1], euler


def _is_well_composed(mask: Bool[Array, "X Y Z"]) -> bool:
    """Whether no two voxels of object or background meet only in an edge or a corner."""
    for axis in range(3):
        rows = np.moveaxis(mask, axis, 0)
        a, b, c, d = rows[:, :-1, :-1], rows[:, 1:, 1:], rows[:, :-1, 1:], rows[:, 1:, :-1]
        if ((a == b) & (c == d) & (a != c)).any():
            return False
    nx, ny, nz = (n - 1 for n in mask.shape)
    cube = [mask[i : nx + i, j : ny + j, k : nz + k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    total = sum(each.astype(np.int8) for each in cube)
    opposite = [(cube[i], cube[7 - i]) for i in range(4)]
    return not any((((total == 2) & a & b) | ((total == 6) & ~a & ~b)).any() for a, b in opposite)


def _require_mask(mask: Array) -> Array:
    if not mask.any():
        raise ValueError("the mask is empty: no voxel passed the threshold or lies in the region")
    return mask


# Division of a volume between markers, by a watershed.

with needing("cortex"):
    import skimage.segmentation

_LEVELS = 255


def watershed_regions(
    height: Float[Array, "X Y Z"], markers: Int[Array, "X Y Z"], mask: Bool[Array, "X Y Z"]
) -> Int[Array, "X Y Z"]:
    """The marker from which each voxel is flooded first, 0 outside the mask. Regions meet where ``height`` is large.

    Parameters
    ----------
    height : array
        In [0, 1]; rounded to 255 levels, so that last bits do not change the result.
    markers : array
        Positive numbers at the voxels where the flood begins, 0 elsewhere.
    mask : array
        The voxels that are divided.

    Raises
    ------
    ValueError
        If there is no marker, or ``height`` is outside [0, 1].

    References
    ----------
    Meyer, *Un algorithme optimal pour la ligne de partage des eaux*, 1991.
    """
    if not (markers > 0).any():
        raise ValueError("markers has no positive value; mark at least one voxel")
    if not (height.min() >= 0 and height.max() <= 1):
        raise ValueError(f"height ranges from {height.min():.4g} to {height.max():.4g}; [0, 1] is needed")
    return skimage.segmentation.watershed(np.round(height * _LEVELS).astype(np.uint8), markers, mask=mask)
