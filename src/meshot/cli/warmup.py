"""``meshot warmup``."""

import argparse
import contextlib
import io

from meshot.cli.common import Commands, add_command


def add_to(commands: Commands) -> None:
    """Add the command ``warmup`` to the parser."""
    command = add_command(
        commands,
        "warmup",
        "Compile all kernels now, and not at their first use.",
        "The command compiles all kernels and stores them: in NUMBA_CACHE_DIR if this variable is set, else beside the "
        "package, or in the user's cache if the package is not writable. Without the extra cortex, it compiles the "
        "kernels of losses and flows only.",
        "meshot warmup",
    )
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    import numpy as np
    import torch
    from tqdm import tqdm

    import meshot
    from meshot._kernels import require_kept
    from meshot.extras import is_installed
    from meshot.flow import spline_values
    from meshot.loss import sliced_partial, sliced_unbalanced, varifold_kernel
    from meshot.mesh import icosphere

    sphere, lines = icosphere(0), meshot.quasi_directions(2, 3)
    moving = meshot.Mesh(sphere.vertices.clone().requires_grad_(), sphere.faces)

    # Each function calls some kernels on very small inputs, in the dtypes that the package uses.
    def sliced() -> None:
        meshot.sliced_wasserstein(meshot.varifold(moving), meshot.varifold(sphere), lines).backward()

    def windowed() -> None:
        meshot.windowed_sliced_wasserstein(sphere, sphere, sphere.vertices[:1], 1.0, 2)

    def partial_and_unbalanced() -> None:
        for loss in (sliced_partial, sliced_unbalanced):
            loss(meshot.varifold(sphere), meshot.varifold(sphere), 1.0, lines)

    def kernel_norm() -> None:
        varifold_kernel(meshot.varifold(moving, normal_scale=1.0), meshot.varifold(sphere, normal_scale=1.0)).backward()

    def exact() -> None:
        points = meshot.DiscreteMeasure(sphere.vertices.clone().requires_grad_())
        for target in (meshot.surface(sphere), points):
            meshot.sliced_wasserstein(meshot.surface(moving), target, lines).backward()

    def grid_flow() -> None:
        for dtype in (torch.float32, torch.float64):
            lattice = torch.zeros(4, 4, 4, 3, dtype=dtype, requires_grad=True)
            spline_values(lattice, torch.full((1, 3), 1.5, dtype=dtype, requires_grad=True)).sum().backward()

    def deformation_network() -> None:
        from meshot.model import DeformationNetwork
        from meshot.volume import Volume

        image = Volume(np.zeros((8, 8, 8), np.float32), np.eye(4))
        for dtype in (torch.float32, torch.float64):
            network = DeformationNetwork(width=4, hidden=(4,), n_scales=1).to(dtype)
            places = torch.full((2, 3), 3.5, dtype=dtype, requires_grad=True)
            network.velocity_in(image, "visited").prepared()(torch.zeros((), dtype=dtype), places).sum().backward()

    def initial_surface() -> None:
        from meshot.volume import Volume, genus_zero, signed_distance

        ball = np.linalg.norm(np.indices((7, 7, 7)) - 3.0, axis=0) < 2.5
        genus_zero(ball, ball.astype(np.float64))
        signed_distance(Volume(ball.astype(np.float64), np.eye(4)))

    calls = [sliced, windowed, partial_and_unbalanced, kernel_norm, exact, grid_flow]
    bar = tqdm([*calls, *((deformation_network, initial_surface) if is_installed("skimage") else ())])
    for call in bar:
        bar.set_description(call.__name__.replace("_", " "))
        with contextlib.redirect_stderr(io.StringIO()):  # the progress bar already names what is compiled
            call()
    require_kept()
