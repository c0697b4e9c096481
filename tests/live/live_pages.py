"""Each live figure of the book with small data of its own."""

import math

import matplotlib.pyplot as plt
import numpy as np
import torch

from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface
from meshot.volume.volume import Volume
from meshot_book.figures.cortex import cut_slice, live_slices
from meshot_book.figures.flows import crossing_data
from meshot_book.live import Answer, live_figure

GENERATOR = np.random.default_rng(3)
ANSWERS = [Answer("yes", "It does.", right=True), Answer("no", "It does: look again.")]
ANGLES = math.pi * (0.5 + (2 * np.arange(24) + 1) / 24)
CORNERS = [[np.cos(t) * r, np.sin(t) * r] for k in range(10) for t, r in [(np.pi * (k / 5 + 0.5), (1.5, 0.5)[k % 2])]]
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1).round(4)
CLOUDS = {name: GENERATOR.normal(size=(9, 2)) + shift for name, shift in (("source", [0.5, 0]), ("target", [-1, 0.3]))}


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
    "rates": {"seed": 1, "lines": 6, "rounds": 40},
    "slices": {"slices": slices_of_balls(), "first": 1, "step": 0.1, "errorStep": 0.05},
    "sorting": {
        "source": [1.0, 2.2, 2.9, 5.5],
        "target": [3.0, 4.4, 0.8, 7.2, 9.3],
        "source_masses": [1, 3, 1, 2],
        "target_masses": [2, 1, 1, 1, 4],
        "exponent": 2,
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
