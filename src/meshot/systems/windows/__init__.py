"""Windows: the same flows, which learn from sliced transport within windows; ours, not in the paper.

Transport within windows of 6 mm does not let missing area far away attract a vertex: see chapter 32.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """Sliced Wasserstein distances between varifolds, within windows around places of the target."""

    name = "windows"
    loss = {  # noqa: RUF012
        "loss": "windowed", "encoding": "varifold", "window": 6.0, "n_windows": 32, "n_directions": 16,
        "normal_scale": 8.0, "p": 1,
    }  # fmt: skip
