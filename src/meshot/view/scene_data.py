"""Compression of surfaces for the interactive view."""

import base64
import zlib
from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps

from meshot.mesh import Mesh
from meshot.view.angles import View
from meshot.view.surface import AMBIENT, PLAIN, framing

# A resolution of 1/100 mm on a brain. Two more bits would cost 10 kB for a surface of 20 000 faces.
LEVELS = 2**14 - 1


def scene_data(
    meshes: Mapping[str, Mesh],
    values: Mapping[str, np.ndarray],
    limits: tuple[float, float],
    colour_map: str,
    view: View,
    aspect: float,
) -> dict:
    """The input of the viewer as JSON values, with all arrays packed into one string.

    Arrays are integers (vertices on a grid, corner indices, colour indices), mostly differences of neighbours. They are
    zigzag-encoded, split into three planes of bytes, compressed together, and encoded in base64. Equal arrays are
    stored once.
    """
    centre, half_height = framing(list(meshes.values()), [view], aspect)
    places = {name: mesh.vertices.detach().cpu().double().numpy() - centre for name, mesh in meshes.items()}
    every = np.concatenate(list(places.values()))
    low, extent = every.min(axis=0), float(np.ptp(every, axis=0).max()) or 1.0
    arrays: dict[bytes, np.ndarray] = {}
    items = []
    for name, mesh in meshes.items():
        vertices = _store(arrays, _vertex_steps(places[name], low, extent))
        faces = _store(arrays, _face_steps(mesh.faces.cpu().numpy()))
        shades = _store(arrays, _shades(values[name], limits)) if name in values else -1
        items.append({"name": name, "vertices": vertices, "faces": faces, "values": shades})
    ramp = (colormaps[colour_map](np.arange(256) / 255) * 255).round().astype(np.uint8)
    return {
        "items": items,
        "lengths": [len(array) for array in arrays.values()],
        "packed": base64.b64encode(zlib.compress(b"".join(arrays), 9)).decode(),
        "low": low.tolist(),
        "step": extent / LEVELS,
        "half": half_height,
        "reach": float(np.linalg.norm(every, axis=1).max()) * 1.01 or 1.0,
        "turn": view.axes.tolist(),
        "plain": PLAIN,
        "ambient": AMBIENT,
        "colours": base64.b64encode(ramp.tobytes()).decode(),
    }


def _store(arrays: dict[bytes, np.ndarray], numbers: np.ndarray) -> int:
    """The index of an array of integers among those stored. Equal arrays share one index; the key is their bytes."""
    numbers = numbers.astype(np.int64)
    zigzag = (numbers << 1) ^ (numbers >> 63)
    planes = b"".join(((zigzag >> shift) & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))
    arrays.setdefault(planes, numbers)
    return list(arrays).index(planes)


def _vertex_steps(places: np.ndarray, low: np.ndarray, extent: float) -> np.ndarray:
    levels = np.rint((places - low) / extent * LEVELS).astype(np.int64)
    return np.diff(levels, axis=0, prepend=0).T.ravel()


def _face_steps(faces: np.ndarray) -> np.ndarray:
    first, second, third = faces.T
    return np.concatenate([np.diff(first, prepend=0), second - first, third - first])


def _shades(numbers: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Colour indices 1 … 255 between the limits; 0 for NaN."""
    share = np.clip((numbers - limits[0]) / (limits[1] - limits[0]), 0, 1)
    return np.where(np.isnan(share), 0, 1 + np.rint(np.nan_to_num(share) * 254)).astype(np.int64)
