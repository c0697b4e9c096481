"""Configurations that no training can have: each is refused with a ValueError, at once."""

import os
import re

import pytest

from meshot.pipeline.segmentation import Augmentation, SegmentationConfig, read_segmentation_config
from meshot.pipeline.training_files import shown_command
from meshot.settings import parsed_yaml, read_groups, read_yaml
from meshot.synth.recipe import read_recipe
from meshot.systems import get_system, read_settings
from meshot.systems.flows import DeformationConfig
from refusals import refuses

#: Nine levels, ten aliases each: 10⁹ values in 300 characters.
BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + before] * 10)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    "text",
    [BOMB, "[" * 3000, "a: [", "a: " + "1" * 5000, "a: 2024-99-99", "a: *b", "\x00", "? [a]\n: 1", "x" * (1 << 21)],
    ids=["bomb", "nested", "open", "long number", "date", "alias", "control", "list as a key", "long"],
)
def test_yaml_that_is_not_read(tmp_path, text):
    (tmp_path / "c.yaml").write_text(text)
    refuses("cannot be read as plain YAML", read_yaml, tmp_path / "c.yaml")
    refuses("cannot be read as plain YAML", read_recipe, tmp_path / "c.yaml")
    (tmp_path / "c.yaml").write_text("{}")
    refuses("the value is no YAML", read_groups, tmp_path / "c.yaml", [f"a.b={text}"])


def test_bytes_that_are_no_text(tmp_path):
    (tmp_path / "c.yaml").write_bytes(b"a: \xff\xfe\xfa")
    refuses("cannot be read as plain YAML", read_segmentation_config, tmp_path / "c.yaml")


def test_what_yaml_is_for_is_read():
    assert parsed_yaml("a: {b: 1.0e-4, c: [1, x], d: null, e: true}") == {
        "a": {"b": 1e-4, "c": [1, "x"], "d": None, "e": True}
    }


@pytest.mark.parametrize("group", ["1", "null", "yes", "2024-01-01", "1.5"])
def test_groups_whose_name_is_no_text_are_named(tmp_path, group):
    (tmp_path / "c.yaml").write_text(f"{group}: {{}}\n")
    refuses("which nothing reads", SegmentationConfig.read, read_groups(tmp_path / "c.yaml"))


def test_a_long_content_is_shown_in_short(tmp_path):
    (tmp_path / "c.yaml").write_text(f"a: {list(range(10_000))}")
    with pytest.raises(ValueError, match="groups of settings are needed") as caught:
        SegmentationConfig.read(read_groups(tmp_path / "c.yaml"))
    assert len(str(caught.value)) < 1000


BAD_DEFORMATION = {
    "network.width=1000000000": "width is 1000000000; an integer in [1, 2048]",
    "network.hidden=[1000000000]": "hidden is 1000000000; an integer in [1, 2048]",
    "network.hidden=[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1]": "number of hidden layers is 17",
    "network.size=1000000001": "an integer in [1, 15]",
    "network.n_scales=1000000000": "an integer in [1, 15]",
    "network.extent=.inf": "extent is inf",
    "network.extent=.nan": "extent is nan",
    "loss.detach_weights=x": "detach_weights is 'x'",
    "training.seed=0.5": "seed is 0.5",
    "training.seed=.nan": "seed is nan",
    "training.learning_rate=.nan": "learning_rate is nan",
}
BAD_SEGMENTATION = {
    "network.width=1000000000": "an integer in [1, 512]",
    "network.depth=1000000000": "an integer in [1, 10]",
    "network.fold=1000000000": "an integer in [1, 8]",
    "training.soft_labels=x": "soft_labels is 'x'",
    "training.soft_labels=1": "soft_labels is 1",
    "training.shift=.nan": "shift is nan",
    "training.shift=.inf": "shift is inf",
    "training.shift=0.5": "shift is 0.5",
    "training.shift=true": "shift is True",
    "training.turn=.inf": "turn is inf",
    "training.dice_weight=-1.0": "dice_weight is -1.0",
    "training.precision=int8": "float32, bfloat16",
    "training.speed=3": "training.speed, which nothing reads",
}


@pytest.mark.parametrize("change", BAD_DEFORMATION)
def test_deformation_settings(change, unchecked):
    with pytest.raises(ValueError, match=re.escape(BAD_DEFORMATION[change])):
        get_system("ddot").prepare(read_settings(get_system("ddot"), "tiny", [change]))


@pytest.mark.parametrize("change", BAD_SEGMENTATION)
def test_segmentation_settings(change, unchecked):
    refuses(re.escape(BAD_SEGMENTATION[change]), read_segmentation_config, "tiny", [change])


def test_the_largest_that_pass():
    assert SegmentationConfig.read({"network": {"width": 2, "depth": 9}}).network.depth == 9
    assert DeformationConfig.read({"network": {"width": 4, "hidden": [2048], "size": 3}}).network.width == 4
    assert Augmentation(shift=10_000).shift == 10_000
    refuses("last level is 1024", SegmentationConfig.read({"network": {"width": 512, "depth": 2}}).new_network)


def test_a_command_with_names_that_are_no_text_can_be_written_down():
    name = os.fsdecode(b"caf\xe9")
    assert "caf\ufffd" in shown_command("train", name, [name], name, [])
