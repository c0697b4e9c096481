"""Windows: flows trained with sliced transport in spatial windows. This system is ours; it is not in the paper.

In windows of 6 mm, missing area does not affect vertices far away: see chapter 32. With the setting
``loss.last_window=3`` their radius falls to 3 mm during the training. The settings ``combined`` have the loss that
chapter 39 chooses. With this loss the flows of the package are trained: see the settings ``shipped``.
"""

from meshot.systems.deformation import DeformationSystem


class System(DeformationSystem):
    """Sliced Wasserstein distances between varifolds, in windows around positions of the target."""

    name = "windows"
    loss = {  # noqa: RUF012
        "loss": "windowed", "encoding": "varifold", "window": 6.0, "n_windows": 32, "n_directions": 16,
        "normal_scale": 8.0, "p": 1,
    }  # fmt: skip
