"""The steps of every system: all weights stand in one box, and what is fitted to settings follows them."""

import pytest

from meshot.model.deformation import DeformationNetwork
from meshot.systems import get_system, read_settings
from meshot.systems.corticalflow import FlowBlock
from meshot.systems.deepcsr import DistanceNetwork
from meshot.systems.vox2cortex import MeshNetwork
from meshot_book.figures.cortex.systems import count_weights, system_steps

NAMES = ("classical", "deepcsr", "vox2cortex", "corticalflow", "cortexode", "ddot")


def networks(name, settings):
    """The networks of one side, made without the drawing."""
    form, template = settings.get("network"), settings.get("template")
    if name == "deepcsr":
        return [DistanceNetwork(2, **form)]
    if name == "vox2cortex":
        return [MeshNetwork(**form, template=template)]
    if name == "corticalflow":
        return [FlowBlock("right", k, **form, template=template) for _ in template["surfaces"] for k in range(3)]
    return [DeformationNetwork(**form)]


@pytest.mark.parametrize(
    ("name", "config", "changes"),
    [
        *((name, config, []) for name in NAMES for config in ("tiny", "small")),
        *((name, "tiny", ["template.surfaces=[white, pial]"]) for name in ("corticalflow", "vox2cortex")),
    ],
)
def test_the_weights_add_up(name, config, changes):
    settings = read_settings(get_system(name), config, changes)
    steps = [step for row in system_steps(name, settings) for step in row]
    wanted = 1 if name == "classical" else count_weights(*networks(name, settings.as_dict()))
    assert sum(step.n_weights for step in steps) == wanted
    assert any("surface" in line for step in steps for line in step.lines)


def test_steps_follow_the_settings():
    settings = read_settings(get_system("corticalflow"), "small", ["training.n_flow_steps=7", "training.method=euler"])
    assert sum("EULER, 7 steps" in line for row in system_steps("corticalflow", settings) for line in row[0].lines) == 3


def test_an_unknown_system_is_refused():
    with pytest.raises(ValueError, match="there is no drawing of 'freesurfer'; name one of classical"):
        system_steps("freesurfer", read_settings(get_system("ddot"), "tiny"))
