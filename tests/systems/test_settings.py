"""The settings of every system: what is refused, and with which words."""

import pytest

from meshot.model.weights import LARGEST_BYTES
from meshot.systems import get_system, read_settings
from refusals import refuses

LARGE = "the weights take .* MB; at most 10 MB are kept"
FLOWS = ("ddot", "cortexode", "windows")
#: System, group, settings, and the beginning of what is said of them.
REFUSED = [
    *((name, "training", {"speed": 1}, r"training\.speed, which nothing reads") for name in (*FLOWS, "classical")),
    *((name, "training", {"n_points": 0}, "n_points is 0; an integer >= 1") for name in (*FLOWS, "classical")),
    *((name, "training", {"seed": -1}, "seed is -1; an integer >= 0") for name in ("ddot", "vox2cortex")),
    *((name, "training", {"patience": "x"}, "patience is 'x'; an integer >= 1") for name in ("ddot", "deepcsr")),
    *((name, "training", {"averaging": 1.0}, r"averaging is 1\.0; a finite number in \[0, 1\)") for name in FLOWS),
    *((name, "training", {"side": "middle"}, "side is 'middle'; one of left, right, both") for name in FLOWS),
    *((name, "training", {"method": "heun"}, "method is 'heun'; one of") for name in (*FLOWS, "corticalflow")),
    *((name, "loss", {"mass": 1}, "mass is set, which .* does not use") for name in FLOWS),
    *((name, "loss", 3, "loss is 3; settings of a loss are needed") for name in FLOWS),
    ("ddot", "loss", {"p": 3}, "p is 3; one of 1, 2"),
    ("ddot", "loss", {"window": 1}, "window is set, which sliced on varifold does not use"),
    ("ddot", "network", {"width": 0}, "width is 0"),
    ("ddot", "network", {"width": 128, "hidden": [2000, 2000]}, LARGE),
    ("corticalflow", "training", {"edge_weight": -1.0}, r"edge_weight is -1\.0; a finite number >= 0"),
    ("corticalflow", "training", {"n_samples": 0}, "n_samples is 0"),
    ("corticalflow", "network", {"velocity_unit": 0.0}, r"velocity_unit is 0\.0; a finite number > 0 is needed, in mm"),
    ("corticalflow", "network", {"width": 64, "depth": 4}, LARGE),
    ("corticalflow", "template", {"shape": "cube"}, "shape is 'cube'; one of fsaverage5, sphere"),
    ("corticalflow", "template", {"surfaces": ["pial"]}, r"surfaces is \['pial'\]; \[white\] or \[white, pial\]"),
    ("vox2cortex", "network", {"n_features": 0}, "n_features is 0"),
    ("vox2cortex", "network", {"depth": 1}, r"depth is 1; an integer in \[2, 10\]"),
    ("vox2cortex", "network", {"width": 64}, LARGE),
    ("vox2cortex", "template", {"splits": -1}, r"splits is -1; an integer in \[0, 3\]"),
    ("vox2cortex", "template", 3, "holds .*; groups of settings are needed, such as training"),
    ("vox2cortex", "loss", {"edge": -5.0}, r"edge is -5\.0"),
    ("vox2cortex", "loss", {"extent": 0.0}, r"extent is 0\.0"),
    ("vox2cortex", "training", {"n_faces": 0}, "n_faces is 0"),
    ("deepcsr", "network", {"hidden": 0}, "hidden is 0"),
    ("deepcsr", "network", {"unit": 0.0}, r"unit is 0\.0"),
    ("deepcsr", "network", {"width": 128}, "the width of the last level is 1024"),
    ("deepcsr", "surface", {"splits": 9}, "splits is 9"),
    ("deepcsr", "surface", {"blur": -1.0}, r"blur is -1\.0"),
    ("deepcsr", "training", {"spread": 0.0}, r"spread is 0\.0"),
    ("deepcsr", "training", {"n_pool": 0}, "n_pool is 0"),
    ("classical", "surface", {"rate": 2.0}, r"rate is 2\.0; a finite number in \[0, 1\]"),
    ("classical", "surface", {"tolerance": 0.0}, r"tolerance is 0\.0; a finite number > 0"),
]


@pytest.mark.parametrize(("name", "group", "settings", "words"), REFUSED)
def test_what_no_training_can_have_is_refused_before_examples_are_read(name, group, settings, words):
    kind = get_system(name)
    refuses(f"the configuration of {name} .*{words}", lambda: kind.prepare(kind.complete({group: settings})))


def test_the_largest_weights():
    assert LARGEST_BYTES == 10_000_000


@pytest.mark.parametrize("name", ["ddot", "corticalflow", "classical"])
def test_settings_come_back_as_they_went_in(name):
    kind = get_system(name)
    settings = read_settings(kind, "tiny", ["training.seed=3"])
    assert kind.complete(settings) is settings
    assert kind.complete(settings.as_dict()) == settings != kind.complete({})


def test_reading_settings_makes_no_network(monkeypatch):
    kind = get_system("vox2cortex")
    monkeypatch.setattr(kind, "new_networks", lambda _: pytest.fail("a network was made"))
    assert kind.surfaces_of(read_settings(kind, "small")) == (("left", "white"), ("right", "white"))
