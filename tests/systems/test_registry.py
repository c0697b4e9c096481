"""Systems are found by name: in their folder, and as entry points of other packages."""

import re

import pytest

from meshot.systems.protocol import get_system, read_settings, system_names
from refusals import refuses

PACKAGE = '''
from meshot.systems.template import System as Template


class System(Template):
    """From elsewhere."""

    name = "elsewhere"
'''


@pytest.fixture
def elsewhere(toys, tmp_path, monkeypatch):
    """An installed package with a system and a setting of its own."""
    place = tmp_path / "meshot_elsewhere"
    place.mkdir()
    (place / "__init__.py").write_text(PACKAGE)
    (place / "quick.yaml").write_text("training: {n_steps: 3}\n")
    info = tmp_path / "meshot_elsewhere-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: meshot-elsewhere\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[meshot.systems]\nelsewhere = meshot_elsewhere:System\n")
    monkeypatch.syspath_prepend(tmp_path)


def test_what_lies_in_the_folder_is_found_and_what_it_shares_is_not(toys):
    names = system_names()
    assert names == sorted(names)
    assert set(toys) <= set(names)
    assert not {"common", "deformation", "registry", "protocol"} & set(names)
    assert all(get_system(name).name == name for name in names)


def test_the_unknown_is_refused_and_the_known_are_listed(toys):
    known = re.escape(", ".join(system_names()))
    refuses(f"there is no system 'nothing'; known are {known}$", get_system, "nothing")


def test_a_package_from_elsewhere_registers_an_entry_point(elsewhere):
    assert "elsewhere" in system_names()
    kind = get_system("elsewhere")
    assert read_settings(kind, "quick").as_dict() == {"training": {"n_steps": 3, "learning_rate": 0.1}}
    assert read_settings(kind, "quick", ["training.learning_rate=2.0"]).training.learning_rate == 2.0
    refuses("elsewhere has no setting 'slow'; it has quick, or name a YAML file", read_settings, kind, "slow")


def test_settings_of_a_file_are_refused_by_its_name(toys, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("training: {speed: 1}")
    with pytest.raises(ValueError, match=r"mine\.yaml: the configuration of template sets training\.speed, which"):
        read_settings(get_system("template"), path)
    refuses(r"none\.yaml does not exist", read_settings, get_system("template"), tmp_path / "none.yaml")
    with pytest.raises(ValueError, match="template has no setting 'small'; it has none, or name a YAML file"):
        read_settings(get_system("template"), "small")
