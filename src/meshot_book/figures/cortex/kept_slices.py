"""Slices of a scan, with the lines of two surfaces and the distance of one from the other, in a small file.

A scan of a person may be too large, or show a face. Slices whose surroundings are black are small, and show a brain.
"""

import base64
import dataclasses
import gzip
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import safetensors.numpy
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from meshot.files import unpacked, whole_file
from meshot.mesh import Mesh, plane_section
from meshot.metrics import Surface
from meshot.types import Array, Float, Shaped
from meshot.view import PLANES, WIDTH, slice_image
from meshot.volume import Volume

#: Positions in a file are multiples of this, in mm, and the numbers of bytes that a file may unpack to.
STEP_MM, LARGEST_BYTES = 0.01, 2**26
#: Positions and distances in the data of the live figure are multiples of these, in mm.
LIVE_STEP_MM, LIVE_ERROR_MM = 0.1, 0.05
#: The lines of the reference and of what was found: colours that differ in brightness on grey, too.
REFERENCE_COLOUR, FOUND_COLOUR = "#f0e442", "#d55e00"

Line = Float[Array, "_ 2"]


@dataclasses.dataclass(frozen=True, eq=False)
class KeptSlice:
    """A slice in scanner RAS, in mm.

    Parameters
    ----------
    plane : str
        "axial", "coronal" or "sagittal".
    position : float
        On the axis across the plane.
    image : array
        Grey values. The first row is at the bottom.
    extent : tuple
        (left, right, bottom, top): the outer edges of the image.
    found, reference : list of array
        The lines of both surfaces.
    signed : list of array
        For each point of ``found``, its distance from the reference surface, negative inside.
    """

    plane: str
    position: float
    image: Shaped[Array, "rows columns"]  # 8 bits
    extent: tuple[float, float, float, float]
    found: list[Line]
    reference: list[Line]
    signed: list[Float[Array, " _"]]


def joined_lines(segments: Float[Array, "n 2 2"]) -> list[Line]:
    """Segments joined at their common ends: closed lines begin and end at the same point.

    Positions are rounded, because two faces compute their common point with different last bits.
    """
    segments = segments.round(4)
    kept = segments[np.abs(segments[:, 0] - segments[:, 1]).max(axis=1) > 0]
    ends: dict[tuple[float, float], list[int]] = {}
    for k, segment in enumerate(kept):
        for end in segment:
            ends.setdefault(tuple(end), []).append(k)
    lines, free = [], np.ones(len(kept), dtype=bool)
    for first in range(len(kept)):
        if not free[first]:
            continue
        free[first] = False
        line = [tuple(kept[first][0]), tuple(kept[first][1])]
        for _ in (0, 1):  # to its end, then from its beginning the other way
            while following := [k for k in ends[line[-1]] if free[k]]:
                free[following[0]] = False
                start, end = map(tuple, kept[following[0]])
                line.append(end if start == line[-1] else start)
            line.reverse()
        lines.append(np.array(line))
    return lines


def thinned(line: Line, tolerance: float) -> list[int]:
    """Indices of points of a line such that all others lie within a distance of the shorter line.

    References
    ----------
    Douglas and Peucker, *Algorithms for the reduction of the number of points*, Cartographica 1973.
    """
    kept, todo = {0, len(line) - 1}, [(0, len(line) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        along = line[last] - line[first]
        length = float(along @ along)
        between = line[first + 1 : last] - line[first]
        share = np.clip(between @ along / length, 0, 1) if length else np.zeros(len(between))
        away = np.linalg.norm(between - share[:, None] * along, axis=1)
        if away.max() > tolerance:
            middle = first + 1 + int(away.argmax())
            kept.add(middle)
            todo += [(first, middle), (middle, last)]
    return sorted(kept)


def cut_slice(
    volume: Volume, plane: str, position: float, found: Sequence[Mesh], reference: Sequence[Surface], tolerance: float
) -> KeptSlice:
    """A slice through a volume of whole grey values up to 255, and through the surfaces of both sides.

    ``found`` and ``reference`` have the sides in the same order. Lines are thinned to a tolerance in mm.
    """
    axis, shown, _ = PLANES[plane]
    image, extent = slice_image(volume, axis, position)
    lines: list[Line] = []
    signed: list[Array] = []
    others: list[Line] = []
    for mesh, surface in zip(found, reference, strict=True):
        for line in joined_lines(plane_section(mesh, axis, position)[:, :, list(shown)].numpy()):
            kept = line[thinned(line, tolerance)]
            points = np.full((len(kept), 3), float(position))
            points[:, list(shown)] = kept
            lines.append(kept)
            signed.append(surface.signed_distances(points))
        for line in joined_lines(plane_section(surface.mesh, axis, position)[:, :, list(shown)].double().numpy()):
            others.append(line[thinned(line, tolerance)])
    whole = np.nan_to_num(np.rint(image)).clip(0, 255).astype(np.uint8)
    return KeptSlice(plane, float(position), whole, extent, lines, others, signed)


def write_slices(path: Path, slices: Sequence[KeptSlice]) -> None:
    """Write slices; the name ends in ``.safetensors.gz``. Positions and distances are rounded to 0.01 mm."""
    tensors, header = {}, []
    for k, each in enumerate(slices):
        tensors[f"{k}/image"] = each.image
        for name in ("found", "reference", "signed"):
            parts = getattr(each, name)
            width = () if name == "signed" else (2,)
            whole = np.concatenate([*parts, np.zeros((0, *width))])
            tensors[f"{k}/{name}"] = np.rint(whole / STEP_MM).astype(np.int16)
            tensors[f"{k}/{name}/lengths"] = np.array([len(part) for part in parts], dtype=np.int32)
        header.append({"plane": each.plane, "position": each.position, "extent": each.extent})
    content = safetensors.numpy.save(tensors, {"slices": json.dumps(header)})
    with whole_file(path) as temporary:
        temporary.write_bytes(gzip.compress(content, compresslevel=9, mtime=0))


def read_slices(path: Path) -> list[KeptSlice]:
    """Read a file of :func:`write_slices`."""
    content = unpacked(path, LARGEST_BYTES)
    length = int.from_bytes(content[:8], "little")
    header = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["slices"])
    tensors = safetensors.numpy.load(content)

    def parts(k: int, name: str) -> list[Array]:
        ends = np.cumsum(tensors[f"{k}/{name}/lengths"])
        return np.split(tensors[f"{k}/{name}"] * STEP_MM, ends)[:-1]  # what follows the last end is empty

    return [
        KeptSlice(
            each["plane"], each["position"], tensors[f"{k}/image"], tuple(each["extent"]),
            parts(k, "found"), parts(k, "reference"), parts(k, "signed"),
        )
        for k, each in enumerate(header)
    ]  # fmt: skip


def kept_slices_figure(
    slices: Mapping[str, KeptSlice],
    names: tuple[str, str],
    windows: Mapping[str, tuple[float, float, float, float]] | None = None,
    marks: Mapping[str, Mapping[str, tuple[float, float]]] | None = None,
    columns: int = 2,
    brightest: float = 140,
) -> Figure:
    """Slices side by side with the lines of both surfaces.

    Parameters
    ----------
    slices : mapping
        By title.
    names : tuple
        Of the surface that was found, and of the reference.
    windows : mapping, optional
        By title, what is shown: (left, right, bottom, top) in mm. By default the whole slice.
    marks : mapping, optional
        By title, letters and their positions.
    columns : int
    brightest : float
        The grey value shown in white.
    """
    windows = {title: (windows or {}).get(title, each.extent) for title, each in slices.items()}
    n_rows = -(-len(slices) // columns)
    ratio = max((top - bottom) / (right - left) for left, right, bottom, top in windows.values())
    size = (WIDTH, n_rows * (WIDTH / columns * ratio + 0.42) + 0.4)
    figure, axes = plt.subplots(n_rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat[len(slices) :]:
        ax.set_axis_off()
    for ax, (title, each) in zip(axes.flat, slices.items()):
        ax.imshow(each.image, extent=each.extent, origin="lower", cmap="gray", vmin=0, vmax=brightest)
        for lines, colour, width, name in (
            (each.reference, REFERENCE_COLOUR, 2.2, names[1]), (each.found, FOUND_COLOUR, 1.1, names[0]),
        ):  # fmt: skip
            drawn = LineCollection(lines, colors=colour, linewidths=width, label=name, capstyle="round")
            ax.add_collection(drawn, autolim=False)
        left, right, bottom, top = windows[title]
        ax.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], facecolor="black", aspect="equal")
        ax.set_title(title, fontsize="medium")
        for letter, place in (marks or {}).get(title, {}).items():
            _mark(ax, letter, place)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    return figure


def _mark(ax: Axes, letter: str, place: tuple[float, float]) -> None:
    around = [withStroke(linewidth=3, foreground="black")]
    ax.text(*place, letter, color="white", ha="center", va="center", fontweight="bold", path_effects=around)


# The data of the live figure: bytes in Base64, since a page is text.


def live_slices(slices: Sequence[KeptSlice], tolerance: float, quality: int, brightest: float = 140) -> list[dict]:
    """Slices as the script ``slices.js`` reads them: small pictures, and lines thinned to a tolerance in mm."""
    found = []
    for each in slices:
        picture = io.BytesIO()
        grey = np.clip(each.image[::-1] / brightest, 0, 1)
        matplotlib.image.imsave(
            picture, grey, format="webp", cmap="gray", vmin=0, vmax=1, pil_kwargs={"quality": quality}
        )
        chosen = [thinned(line, tolerance) for line in each.found]
        ours = [line[part] for line, part in zip(each.found, chosen)]
        theirs = [line[thinned(line, tolerance)] for line in each.reference]
        errors = np.concatenate([part[kept] for part, kept in zip(each.signed, chosen)])
        whole = np.rint(errors / LIVE_ERROR_MM).clip(-127, 127).astype(np.int8)
        found.append(
            {
                "position": each.position,
                "extent": [round(edge, 3) for edge in each.extent],
                "picture": _text(picture.getvalue()),
                "found": _packed_lines(ours),
                "reference": _packed_lines(theirs),
                "errors": _text(whole.tobytes()),
            }
        )
    return found


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _packed_lines(lines: Sequence[Line]) -> str:
    """For each line its number of points and its first point with two bytes each, then steps with two bytes or six.

    A step is two signed bytes; if one does not hold it, the byte −128 and two numbers of two bytes follow.
    """
    content = bytearray()
    for line in lines:
        whole = np.rint(line / LIVE_STEP_MM).astype(int)
        for number in (len(whole), *whole[0]):
            content += int(number).to_bytes(2, "little", signed=True)
        for step in np.diff(whole, axis=0):
            if np.abs(step).max() <= 127:
                content += np.array(step, dtype=np.int8).tobytes()
            else:
                content += b"\x80" + b"".join(int(number).to_bytes(2, "little", signed=True) for number in step)
    return _text(bytes(content))


def live_numbers(slices: Sequence[Mapping[str, object]], limit: float) -> list[dict[str, float]]:
    """What the live figure shows of each slice: length, mean signed error, share farther than a limit (in mm).

    Each piece of a line counts by its length, with the mean error of its ends.
    """
    numbers = []
    for each in slices:
        errors = np.frombuffer(base64.b64decode(each["errors"]), dtype=np.int8) * LIVE_ERROR_MM
        lengths, means, start = [], [], 0
        for line in unpacked_lines(each["found"]):
            own = errors[start : start + len(line)]
            start += len(line)
            lengths.append(np.linalg.norm(np.diff(line, axis=0), axis=1))
            means.append((own[1:] + own[:-1]) / 2)
        length, mean = np.concatenate(lengths), np.concatenate(means)
        numbers.append(
            {
                "length": float(length.sum()),
                "mean": float(length @ mean / length.sum()),
                "beyond": float(length[np.abs(mean) > limit].sum() / length.sum()),
            }
        )
    return numbers


def unpacked_lines(text: str) -> list[Line]:
    """The lines of a slice of :func:`live_slices`, in mm."""
    content, place, lines = base64.b64decode(text), 0, []

    def number(n_bytes: int) -> int:
        nonlocal place
        place += n_bytes
        return int.from_bytes(content[place - n_bytes : place], "little", signed=True)

    while place < len(content):
        count, points = number(2), [[number(2), number(2)]]
        for _ in range(count - 1):
            step = number(1)
            steps = (number(2), number(2)) if step == -128 else (step, number(1))
            points.append([points[-1][0] + steps[0], points[-1][1] + steps[1]])
        lines.append(np.array(points) * LIVE_STEP_MM)
    return lines
