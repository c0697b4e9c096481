"""Each live figure of the book with small data of its own."""

import math

import matplotlib.pyplot as plt
import numpy as np
import scipy.ndimage
import torch

from meshot.mesh import icosphere
from meshot.volume import Volume, volume_pyramid
from meshot_book.figures.flows import crossing_data
from meshot_book.figures.measures import Window
from meshot_book.live import Answer, live_figure

GENERATOR = np.random.default_rng(3)
ANSWERS = [Answer("yes", "It does.", right=True), Answer("no", "It does: look again.")]
ANGLES = math.pi * (0.5 + (2 * np.arange(24) + 1) / 24)
CORNERS = [[np.cos(t) * r, np.sin(t) * r] for k in range(10) for t, r in [(np.pi * (k / 5 + 0.5), (1.5, 0.5)[k % 2])]]
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1).round(4)
#: Fractions of a porous block in hundredths, and its depths in tenths of a millimetre, from 50 on.
BLOCK = scipy.ndimage.gaussian_filter(GENERATOR.normal(size=(9, 7, 8)), 0.8)
BLOCK = np.clip(50 + 90 * BLOCK, 0, 99).round().astype(int)
DEPTHS = np.clip((BLOCK - 50) // 3 + 50 + GENERATOR.integers(-2, 3, BLOCK.shape), 0, 99)
#: A scan of 20³ voxels of 1.5 mm with a bright ball of 9 mm, its coarser levels, and a section of all between voxels.
SCAN = Volume(np.zeros((20, 20, 20)), np.diag([1.5, 1.5, 1.5, 1.0]))
GRID = np.moveaxis(np.indices(SCAN.data.shape), 0, -1) * 1.5 - 14.25
SCAN = SCAN.with_data(np.clip(0.55 - 0.2 * (np.linalg.norm(GRID, axis=-1) - 9), 0.1, 0.9) + 0.05 * np.sin(GRID.sum(-1)))
LEVELS = volume_pyramid(SCAN, 3)
SECTION = 11.6  # mm


def section_of(level):
    """A level between two of its planes, in hundredths."""
    place = (SECTION - level.affine[1, 3]) / level.affine[1, 1]
    below, share = int(place), place - int(place)
    plane = (1 - share) * level.data[:, below] + share * level.data[:, below + 1]
    return {
        "values": "".join(f"{value:02d}" for value in np.clip(100 * plane, 0, 99).round().astype(int).ravel()),
        "shape": list(plane.shape),
        "origin": [level.affine[0, 3], level.affine[2, 3]],
        "step": [level.affine[0, 0], level.affine[2, 2]],
    }


#: A bright disc of 7 mm in a grey one of 9.5 mm, both cut into squares of 0.5 mm, and its border in ¼ % of 12 mm.
SQUARES = (np.indices((48, 48)) + 0.5) / 2 - 12
WITHIN = [np.clip(2 * (radius - np.hypot(*SQUARES)), 0, 0.99) for radius in (7, 9.5)]
TISSUES = {"white": WITHIN[0], "grey": np.clip(WITHIN[1] - WITHIN[0], 0, 0.99)}
TURNS = np.linspace(0, 2 * np.pi, 101)
DISC = np.rint(400 / 12 * 7 * np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)).astype(int)
#: Two errors of a sphere; EMD was not measured with the most points.
SPHERE_WINDOW = Window(torch.tensor([0.0, 0.0, 10.0], dtype=torch.float64), 1, 6.0)
SPHERE_FLOORS = {"EMD": [[3, 3.2, 2.9], [1, 1.2, 0.9], None], "ASSD": 3 * [3 * [0]], "exact": 3 * [3 * [0]]}
SPHERE_VALUES = {"EMD": [3.1, 2.5, None], "ASSD": [0.5, 0.51, 0.52], "exact": 3 * [0.55]}


def sphere_state(shift, ratios, **values):
    """The sphere shifted upwards."""
    sphere = icosphere(3, 10.0)
    lines = SPHERE_WINDOW.chains(sphere.with_vertices(sphere.vertices + torch.tensor([0.0, 0.0, shift])))
    state = {"size": f"{shift:g} mm", "lines": lines, "values": ["1.5", "12", "0"], "ratios": ratios}
    return state | {"measured": SPHERE_VALUES | values}


CLOUDS = {name: GENERATOR.normal(size=(9, 2)) + shift for name, shift in (("source", [0.5, 0]), ("target", [-1, 0.3]))}
#: Name of the script → its data.
DATA = {
    "calculator": {
        "peers": ["sorts", "compares"],
        "rows": [
            {"peer": peer, "d": d, "m": m, "seconds": m**power / 1e6, "low": m**power / 2e6, "high": m**power / 5e5}
            | {"megabytes": m * d / 1e4}
            for peer, power, most in (("sorts", 1, 1e6), ("compares", 2, 1e4))
            for d in (3, 6)
            for m in (1000, 10_000, 100_000, 1_000_000)
            if m <= most
        ],
        "stopped": [{"peer": "compares", "d": 3, "m": 100_000, "why": "time: 10000 s foretold"}],
    },
    "crossing": crossing_data() | {"time": 0.1},
    "descent": {"corners": np.round(CORNERS, 4).tolist(), "points": RING.tolist(), "seed": 1},
    "cubes": {
        "levels": [section_of(level) for level in LEVELS],
        "border": (14.25 + 8.6 * np.stack([np.cos(TURNS[:-1]), np.sin(TURNS[:-1])], axis=1)).round(2).ravel().tolist(),
        "size": 5,
        "smooth": 1,
        "along": 20,
        "offset": -4,
        "view": {"low": [-1, -1], "high": [29, 29]},
    },
    "floors": {
        "floors": {
            "SWD": {"m": [1000, 10_000, 100_000], "mean": [2, 0.7, 0.2], "spread": [0.5, 0.2, 0.06]},
            "EMD": {"m": [1000, 8000], "mean": [7.5, 3.4], "spread": [0.5, 0.2], "area": 66_000, "c": 1},
            "ASSD": {"m": [], "mean": [], "spread": []},
        },
        "levels": {
            "SWD": {"shift": 0.3, "noise": 0.2, "turned faces": 0},
            "EMD": {"shift": 0.5, "noise": 0.35, "turned faces": 0},
            "ASSD": {"shift": 0.25, "noise": 0.3, "turned faces": 1e-12},
        },
    },
    "imaging": {
        "n": 48,
        "step": 0.5,
        "sizes": [0.5, 1, 2, 3],
        "means": {"white": 440, "grey": 310},
        "fractions": {
            name: "".join(f"{value:02d}" for value in np.rint(100 * part).astype(int).ravel())
            for name, part in TISSUES.items()
        },
        "border": [DISC.ravel().tolist()],
    },
    "planted": {
        "start": {"error": "shift", "size": 1, "metric": "EMD", "count": 1000},
        "counts": [100, 1000, 20_000],
        "metrics": ["EMD", "ASSD", "crossing"],
        "exact": "exact",
        "seen": 2,
        "floors": SPHERE_FLOORS,
        "reference": {"EMD": [3, 1.1, None], "ASSD": [0.1, 0.1, 0.1], "exact": [0.1, 0.1, 0.1]},
        "errors": {
            name: {"half": 6, "bar": 2, "target": SPHERE_WINDOW.chains(icosphere(3, 10.0)), "states": states}
            for name, states in {
                "shift": [
                    sphere_state(0.1, [0.5, 2.0, 0.0], EMD=[3, 1.2, None]),
                    sphere_state(1.0, [1.4, 2.01, None]),
                    sphere_state(2.0, [40, 300, None]),
                ],
                "nothing": [sphere_state(0.0, [1, 0, 0], ASSD=[0, 1e-12, 0])],
            }.items()
        },
    },
    "rates": {"seed": 1, "lines": 6, "rounds": 40},
    "sorting": {
        "source": [1.0, 2.2, 2.9, 5.5],
        "target": [3.0, 4.4, 0.8, 7.2, 9.3],
        "source_masses": [1, 3, 1, 2],
        "target_masses": [2, 1, 1, 1, 4],
        "exponent": 2,
    },
    "repair": {"angle": 60, "narrowing": 1.2},
    "threshold": {
        "shape": list(BLOCK.shape),
        "fractions": "".join(f"{value:02d}" for value in BLOCK.ravel()),
        "depths": "".join(f"{value:02d}" for value in DEPTHS.ravel()),
        "weight": 12,
        "priority": "depth and fraction",
        "slice": 3,
    },
    "turning": {name: points.round(4).tolist() for name, points in CLOUDS.items()} | {"angle": 30},
}


def live_page_of(name, **changed):
    """The page of a figure."""
    figure = plt.figure(figsize=(2, 1))
    given = {
        "question": "Does <it> move?",
        "answers": ANSWERS,
        "seen": "It moves.",
        "still": figure,
        "alt": "a <figure>",
    }
    return live_figure(name, DATA[name], **given | changed)
