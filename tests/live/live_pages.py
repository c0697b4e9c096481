"""Each live figure of the book with small data of its own."""

import itertools
import math

import matplotlib.pyplot as plt
import numpy as np

from meshot_book.figures.flows import crossing_data
from meshot_book.live import Answer, live_figure

GENERATOR = np.random.default_rng(3)
ANSWERS = [Answer("yes", "It does.", right=True), Answer("no", "It does: look again.")]
ANGLES = math.pi * (0.5 + (2 * np.arange(24) + 1) / 24)
CORNERS = [[np.cos(t) * r, np.sin(t) * r] for k in range(10) for t, r in [(np.pi * (k / 5 + 0.5), (1.5, 0.5)[k % 2])]]
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1).round(4)
CLOUDS = {name: GENERATOR.normal(size=(9, 2)) + shift for name, shift in (("source", [0.5, 0]), ("target", [-1, 0.3]))}
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
    "luck": {"count": 6, "between": 0.0065, "subject": 0.01, "subjects": 4, "lead": 0.017},
    "power": {
        "outcomes": {
            "thickness (mm)": {"effect": 0.8, "between": 1.0, "method": math.sqrt(1 / 0.6 - 1), "unit": "mm"},
            "volume (ml)": {"effect": 40, "between": 50, "method": 4, "unit": "ml"},
        },
        "pilot": 12,
    },
    "rates": {"seed": 1, "lines": 6, "rounds": 40},
    "slices": {name: points.round(4).tolist() for name, points in CLOUDS.items()}
    | {"lines": np.stack([np.cos(ANGLES[:12]), np.sin(ANGLES[:12])], axis=1).tolist(), "angle": 60},
    "sorting": {
        "source": [1.0, 2.2, 2.9, 5.5],
        "target": [3.0, 4.4, 0.8, 7.2, 9.3],
        "source_masses": [1, 3, 1, 2],
        "target_masses": [2, 1, 1, 1, 4],
        "exponent": 2,
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
