"""Each live figure of the book with small data of its own."""

import itertools
import math

import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.ndimage
import torch

from meshot import quasi_directions
from meshot.mesh import icosphere
from meshot.metrics import Surface
from meshot.volume import Volume, volume_pyramid
from meshot_book.figures.cortex import cut_slice, live_slices
from meshot_book.figures.flows import contour_data, crossing_data
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
FAULTS = ["crowded 3 : 1", "a quarter missing", "a tenth far away", "one outlier"]
FAULTS += ["bump of 6 mm", "moved by 3 mm", "a quarter flipped"]


def slices_of_balls():
    """Two slices through a ball of radius 30 and one of 31.5 mm, which touch on the right."""
    ball, other = icosphere(4, 30.0), icosphere(4, 31.5)
    ball = ball.with_vertices(ball.vertices.double() + torch.tensor([1.5, 0.0, 0.0]))
    affine = np.eye(4)
    affine[:3, 3] = -40.0
    scan = Volume(np.full((80, 80, 80), 90.0), affine)
    cuts = [cut_slice(scan, "coronal", y, [ball], [Surface(other)], 0.05) for y in (-12.0, 0.1)]
    return live_slices(cuts, 0.1, 40)


#: Name of the script → its data.
DATA = {
    "ablation": {
        "trainings": [
            {
                "name": name,
                "steps": list(range(28, 28 * 31, 28)),
                "loss": GENERATOR.uniform(1, 3, 30).round(4).tolist(),
                "checks": [
                    {
                        "step": step,
                        "ASSD": round(GENERATOR.uniform(0.2, 0.6), 4),
                        "normals": round(GENERATOR.uniform(), 4),
                    }
                    for step in (280, 560, 840)
                ],
            }
            for name in ("DDOT", "Chamfer", "windows")
        ],
        "every": 28,
        "units": {"ASSD": " mm", "normals": ""},
        "start": {"ASSD": 0.4, "normals": 0},
    },
    "blur": {"points": (40 * RING[::2] + [0, 5]).tolist(), "target": (40 * RING[::2]).tolist()}
    | {"blur": 20, "range": [58, 55]},
    "budget": {
        "courses": [
            {
                "group": group,
                "name": f"{group} {k}",
                "step": (steps := list(range(60 + 20 * k, 1000 * (k + 2), 170))),
                "assd": GENERATOR.uniform(0.2, 0.7, len(steps)).round(4).tolist(),
                "rates": [0.3, 0.4, 0.35],
            }
            for group in ("readings", "controls")
            for k in range(9 if group == "controls" else 3)
        ],
        "start": 0.4,
        "short": 280,
        "budget": 2.5,
    },
    "apart": {"radii": [40, 38], "lines": 6, "seed": 1, "rounds": 60},
    "blocks": {"shift": 2, "stretch": 1, "count": 9, "rounds": 100},
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
    "concave": {
        "p": 1,
        "source": [2, 3.5],
        "target": [6, 8],
        "more": {"source": [1.0, 2.2, 2.9, 5.5], "target": [3.0, 4.4, 0.8, 7.2]},
    },
    "contour": contour_data(),
    "crossing": crossing_data() | {"time": 0.1},
    "descent": {"corners": np.round(CORNERS, 4).tolist(), "points": RING.tolist(), "seed": 1},
    "inverse": {
        "points": GENERATOR.uniform(-1, 1, (40, 2)).round(4).tolist(),
        "drift": [0.7, -0.4],
        "reach": 0.8,
        "strengths": [1, 2, 4],
    },
    "ghost": {"count": 4, "angles": [10, 38, 66, 97, 119, 150, 172], "probe": 40},
    "normals": {"power": -0.5, "gap": 2, "lines": 60, "seed": 1},
    "detection": {
        "fault": "one outlier",
        "points": 30,
        "pairs": 48,
        "powers": {fault: [0.5, 0.25, 1] for fault in FAULTS},
        "radius": 40,
        "normal_scale": 10,
        "bump": (40 * RING * np.where(np.arange(24) == 3, 1.15, 1)[:, None]).tolist(),
        "lines": {d: quasi_directions(16, d).tolist() for d in (2, 4)},
    },
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
    "thickness": {"depth": 5.0, "wave": 16.0, "gap": 2.5, "slide": 0.0, "place": 16.0, "length": 48.0},
    "missing": {
        "areas": [3.0, 5.0, 2.0, 4.0, 4.0, 6.0, 1.0, 5.0, 3.0, 2.0] * 8,
        "low": -80.0,
        "slab": 2.0,
        "needed": 0.4,
        "reach": 6.0,
        "missing": 5.0,
        "width": 40.0,
        "middle": 46.0,
        "place": 0.0,
    },
    "luck": {"count": 6, "between": 0.0065, "subject": 0.01, "subjects": 4, "lead": 0.017},
    "power": {
        "outcomes": {
            "thickness (mm)": {"effect": 0.8, "between": 1.0, "method": math.sqrt(1 / 0.6 - 1), "unit": "mm"},
            "volume (ml)": {"effect": 40, "between": 50, "method": 4, "unit": "ml"},
        },
        "pilot": 12,
    },
    "layers": {"width": 1.05, "spacing": 1.5, "length": 16, "seed": 1, "positions": 40, "most": 60},
    "rates": {"seed": 1, "lines": 6, "rounds": 40},
    "scene": {
        "scenes": {
            "equal": {"source": RING.tolist(), "target": RING.tolist(), "flipped": [False] * 24},
            "aside": {
                "source": (30 * RING).tolist(),
                "target": np.roll(RING * [40, 20], 5, axis=0).tolist(),
                "flipped": [False] * 24,
            },
            "flips": {
                "source": (40 * RING).tolist(),
                "target": (40 * RING).tolist(),
                "flipped": [k < 6 for k in range(24)],
            },
        },
        "scene": "aside",
        "blur": 10,
        "normal_scale": 10,
        "lines": {d: quasi_directions(16, d).tolist() for d in (2, 4)},
    },
    "slices": {"slices": slices_of_balls(), "first": 1, "step": 0.1, "errorStep": 0.05},
    "learned": {name: points.round(4).tolist() for name, points in CLOUDS.items()}
    | {"lines": np.stack([np.cos(ANGLES[:12]), np.sin(ANGLES[:12])], axis=1).tolist(), "angle": 60},
    "sorting": {
        "source": [1.0, 2.2, 2.9, 5.5],
        "target": [3.0, 4.4, 0.8, 7.2, 9.3],
        "source_masses": [1, 3, 1, 2],
        "target_masses": [2, 1, 1, 1, 4],
        "exponent": 2,
    },
    "tent": {"corners": [[-1.2, -0.6], [1.3, -0.3], [-0.5, 1.2]], "angle": 10},
    "repair": {"angle": 60, "narrowing": 1.2},
    "threshold": {
        "shape": list(BLOCK.shape),
        "fractions": "".join(f"{value:02d}" for value in BLOCK.ravel()),
        "depths": "".join(f"{value:02d}" for value in DEPTHS.ravel()),
        "weight": 12,
        "priority": "depth and fraction",
        "slice": 3,
    },
    "tables": {
        "measures": {
            "ASSD": {"unit": " mm", "digits": 3, "sign": 1},
            "normals": {"unit": "", "digits": 3, "sign": -1},
            "crossing": {"unit": " %", "digits": 2, "sign": 1},
        },
        "rows": [
            {"column": column, "budget": budget, "system": system}
            | {"ASSD": [round(own, 4), 0.05], "normals": [round(1 - own * other, 4), 0.02], "crossing": [k % 3, 0.5]}
            for column, budget in itertools.product(("one", "two"), ("steps", "seconds"))
            for k, system in enumerate(("A", "B", "C", "D", "start", "perfect"))
            for own, other in [GENERATOR.uniform(0.1, 1, 2)]
            if (system, budget) != ("D", "seconds")
        ],
        "columns": ["one", "two"],
        "order": "ASSD",
        "ours": "A",
        "start": "start",
        "floor": "perfect",
    },
    "turning": {name: points.round(4).tolist() for name, points in CLOUDS.items()} | {"angle": 30},
    "windows": {"points": 96, "width": 96, "height": 3, "wave": 16, "lines": 16, "every": 6, "first": 3},
}

#: One figure of each kind, played, moved by hand, on a picture, and with sliders alone. What only depends on the panel
#: that all figures share is tried on these, and on all others by ``make test-all``.
KINDS = ("descent", "sorting", "slices", "power")
BY_KIND = [pytest.param(name, marks=[] if name in KINDS else pytest.mark.thorough) for name in DATA]


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
