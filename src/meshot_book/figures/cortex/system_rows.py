"""What each system does, as rows of steps for a drawing. Numbers come from its settings and from its networks."""

from collections.abc import Callable

from torch import nn

from meshot.settings import Settings
from meshot.systems import get_system
from meshot_book.figures.cortex.systems import SystemStep

_Rows = list[list[SystemStep]]


def count_weights(*modules: nn.Module) -> int:
    """The number of learned weights of modules together."""
    return sum(parameter.numel() for module in modules for parameter in module.parameters())


def system_steps(name: str, settings: Settings) -> _Rows:
    """The steps of a system with some settings, from the scan to a surface.

    Parameters
    ----------
    name : str
        One of "classical", "deepcsr", "vox2cortex", "corticalflow", "cortexode" and "ddot".
    settings : Settings
        See :func:`meshot.systems.read_settings`.

    Raises
    ------
    ValueError
        If there is no drawing of that system.
    """
    if name not in _DRAWN:
        raise ValueError(f"there is no drawing of {name!r}; name one of {', '.join(_DRAWN)}")
    return _DRAWN[name](settings)


def _data(*lines: str) -> SystemStep:
    return SystemStep("data", lines)


def _fixed(*lines: str) -> SystemStep:
    return SystemStep("fixed", lines)


def _learned(n_weights: int, *lines: str) -> SystemStep:
    return SystemStep("learned", lines, n_weights)


def _classical(settings: Settings) -> _Rows:
    surface = settings.surface
    return [
        [_data("scan"), _data("mean white matter of", "the training subjects")],
        [_fixed("bias correction: the scan relative to", "the brightness of deep white matter")],
        [_learned(1, "threshold")],
        [_fixed("largest component, filled cavities,", "genus 0, marching cubes")],
        [_fixed(f"{surface.rounds} moves to the steepest edge, up to", f"{surface.reach} mm away, and smoothing")],
        [_data("surface")],
    ]


def _deepcsr(settings: Settings) -> _Rows:
    network = get_system("deepcsr").new_networks(settings)["distances"]
    encoder = count_weights(network.encoder, network.of_whole)
    n_maps = len(network.encoder.widths)
    n_blocks = settings.network.n_blocks
    return [
        [_data("scan"), _data("a position x, in mm")],
        [_learned(encoder, f"encoder: maps of {n_maps} resolutions,", "and one vector for the whole scan")],
        [_fixed("features at x, by interpolation in every map")],
        [
            _learned(
                count_weights(network) - encoder, f"decoder: {n_blocks} residual blocks that", "read x and its features"
            )
        ],
        [_data("signed distances of x from the surfaces")],
        [_fixed("all x of a grid: smoothing, largest", "component, genus 0, marching cubes")],
        [_data("surface")],
        [_fixed("in training only: absolute error of the", "distances of random points")],
    ]


def _vox2cortex(settings: Settings) -> _Rows:
    network = get_system("vox2cortex").new_networks(settings)["meshes"]
    image = count_weights(network.unet, network.to_classes)
    return [
        [_data("scan"), _data("templates, left and right" if len(network.kinds) == 1 else "white and pial templates")],
        [_learned(image, "residual U-Net: maps of all levels,", "and a segmentation (for the loss)")],
        [_fixed(f"{len(network.stages)} stages, coarse maps first:", "features of the maps at every vertex")],
        [_learned(count_weights(network) - image, "in each stage: graph networks", "move every vertex")],
        [_data("a surface after every stage")],
        [_fixed("in training only: Chamfer weighted by", "curvature, normals, evenness, at every stage")],
    ]


def _corticalflow(settings: Settings) -> _Rows:
    training = settings.training
    steps = f"flow: {training.method.upper()}, {training.n_flow_steps} steps"
    rows = [[_data("scan"), _data("template")]]
    for part, network in get_system("corticalflow").new_networks(settings).items():
        side, kind, number = part.split("_")
        if side == "right":
            continue
        k = int(number) - 1  # grids before this one, in its cascade
        if kind == "pial" and not k:
            rows.append([_data("white surface")])
        reads = "reads the scan" if not k else f"reads the scan and {k} velocity grid{'s' * (k > 1)}"
        rows.append([_learned(count_weights(network), f"U-Net {k + 1}: a velocity grid;", reads)])
        rows.append([_fixed(f"the vertices follow this grid ({steps})")])
    loss = _fixed("in training only, block by block: Chamfer", "between drawn points, and edge length")
    return [*rows, [_data("surface")], [loss]]


def _deformation(settings: Settings, loss: tuple[str, str]) -> _Rows:
    network, training = settings.new_network(), settings.training
    form = network.config()
    cubes = f"cubes of {form['size']}³ voxels at {form['n_scales']} scales"
    return [
        [_data("scan"), _data("initial surface,", "from the segmentation")],
        [_learned(count_weights(network), "velocity at x, from x and", cubes)],
        [_fixed(f"flow: {training.method.capitalize()}, {training.n_flow_steps} steps")],
        [_data("surface")],
        [_fixed(*loss)],
    ]


def _cortexode(settings: Settings) -> _Rows:
    return _deformation(settings, ("in training only: Chamfer between points", "drawn from both surfaces"))


def _ddot(settings: Settings) -> _Rows:
    n = settings.loss.loss.n_directions
    return _deformation(
        settings, (f"in training only: sliced Wasserstein, {n} directions,", "between centres and normals of all faces")
    )


_DRAWN: dict[str, Callable[[Settings], _Rows]] = {
    "classical": _classical,
    "deepcsr": _deepcsr,
    "vox2cortex": _vox2cortex,
    "corticalflow": _corticalflow,
    "cortexode": _cortexode,
    "ddot": _ddot,
}
