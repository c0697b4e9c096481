"""Each live figure of the book with small data of its own."""

import math

import matplotlib.pyplot as plt
import numpy as np

from meshot import quasi_directions
from meshot_book.figures.flows import crossing_data
from meshot_book.live import Answer, live_figure

GENERATOR = np.random.default_rng(3)
ANSWERS = [Answer("yes", "It does.", right=True), Answer("no", "It does: look again.")]
ANGLES = math.pi * (0.5 + (2 * np.arange(24) + 1) / 24)
CORNERS = [[np.cos(t) * r, np.sin(t) * r] for k in range(10) for t, r in [(np.pi * (k / 5 + 0.5), (1.5, 0.5)[k % 2])]]
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1).round(4)
CLOUDS = {name: GENERATOR.normal(size=(9, 2)) + shift for name, shift in (("source", [0.5, 0]), ("target", [-1, 0.3]))}
FAULTS = ["crowded 3 : 1", "a quarter missing", "a tenth far away", "one outlier"]
FAULTS += ["bump of 6 mm", "moved by 3 mm", "a quarter flipped"]
#: Name of the script → its data.
DATA = {
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
    "crossing": crossing_data() | {"time": 0.1},
    "descent": {"corners": np.round(CORNERS, 4).tolist(), "points": RING.tolist(), "seed": 1},
    "ghost": {"count": 4, "angles": [10, 38, 66, 97, 119, 150, 172], "probe": 40},
    "normals": {"power": -0.5, "gap": 2, "lines": 60, "seed": 1},
    "power": {
        "fault": "one outlier",
        "points": 30,
        "pairs": 48,
        "powers": {fault: [0.5, 0.25, 1] for fault in FAULTS},
        "radius": 40,
        "normal_scale": 10,
        "bump": (40 * RING * np.where(np.arange(24) == 3, 1.15, 1)[:, None]).tolist(),
        "lines": {d: quasi_directions(16, d).tolist() for d in (2, 4)},
    },
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
    "sorting": {
        "source": [1.0, 2.2, 2.9, 5.5],
        "target": [3.0, 4.4, 0.8, 7.2, 9.3],
        "source_masses": [1, 3, 1, 2],
        "target_masses": [2, 1, 1, 1, 4],
        "exponent": 2,
    },
    "tent": {"corners": [[-1.2, -0.6], [1.3, -0.3], [-0.5, 1.2]], "angle": 10},
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
