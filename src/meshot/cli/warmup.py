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
    from tqdm import tqdm

    from meshot._kernels import require_kept
    from meshot.extras import is_installed

    of_scans = (_deformation_network, _initial_surface) if is_installed("skimage") else ()
    bar = tqdm((_sliced, _windowed, _partial_and_unbalanced, _kernel_norm, _exact, _grid_flow, *of_scans))
    for call in bar:
        bar.set_description(call.__name__.strip("_").replace("_", " "))
        with contextlib.redirect_stderr(io.StringIO()):  # the progress bar already names what is compiled
            call()
    require_kept()


# Each function below calls some kernels on very small inputs, in the dtypes that the package uses.


def _sliced() -> None:
    import meshot
    from meshot.mesh import icosphere

    sphere = icosphere(0)
    moving = meshot.Mesh(sphere.vertices.requires_grad_(), sphere.faces)
    meshot.sliced_wasserstein(
        meshot.varifold(moving), meshot.varifold(sphere), meshot.quasi_directions(2, 3)
    ).backward()


def _windowed() -> None:
    import meshot
    from meshot.mesh import icosphere

    sphere = icosphere(0)
    meshot.windowed_sliced_wasserstein(sphere, sphere, sphere.vertices[:1], 1.0, 2)


def _partial_and_unbalanced() -> None:
    import meshot
    from meshot.loss import sliced_partial, sliced_unbalanced
    from meshot.mesh import icosphere

    sphere = meshot.varifold(icosphere(0))
    for loss in (sliced_partial, sliced_unbalanced):
        loss(sphere, sphere, 1.0, meshot.quasi_directions(2, 3))


def _kernel_norm() -> None:
    import meshot
    from meshot.loss import varifold_kernel
    from meshot.mesh import icosphere

    sphere = icosphere(0)
    moving = meshot.Mesh(sphere.vertices.requires_grad_(), sphere.faces)
    varifold_kernel(meshot.varifold(moving, normal_scale=1.0), meshot.varifold(sphere, normal_scale=1.0)).backward()


def _exact() -> None:
    import meshot
    from meshot.mesh import icosphere

    sphere = icosphere(0)
    moving = meshot.Mesh(sphere.vertices.requires_grad_(), sphere.faces)
    points = meshot.DiscreteMeasure(sphere.vertices.detach().clone().requires_grad_())
    for target in (meshot.surface(sphere), points):
        meshot.sliced_wasserstein(meshot.surface(moving), target, meshot.quasi_directions(2, 3)).backward()


def _grid_flow() -> None:
    import torch

    from meshot.flow import spline_values

    for dtype in (torch.float32, torch.float64):
        lattice = torch.zeros(4, 4, 4, 3, dtype=dtype, requires_grad=True)
        spline_values(lattice, torch.full((1, 3), 1.5, dtype=dtype, requires_grad=True)).sum().backward()


def _deformation_network() -> None:
    import torch

    from meshot.model import DeformationNetwork
    from meshot.volume import Volume

    image = Volume(torch.zeros(8, 8, 8).numpy(), torch.eye(4, dtype=torch.float64).numpy())
    for dtype in (torch.float32, torch.float64):
        network = DeformationNetwork(width=4, hidden=(4,), n_scales=1).to(dtype)
        places = torch.full((2, 3), 3.5, dtype=dtype, requires_grad=True)
        network.velocity_in(image, "visited").prepared()(torch.zeros((), dtype=dtype), places).sum().backward()


def _initial_surface() -> None:
    import numpy as np

    from meshot.volume import Volume, genus_zero, signed_distance

    ball = np.linalg.norm(np.indices((7, 7, 7)) - 3.0, axis=0) < 2.5
    genus_zero(ball, ball.astype(np.float64))
    signed_distance(Volume(ball.astype(np.float64), np.eye(4)))
