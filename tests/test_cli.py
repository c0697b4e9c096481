import json
from importlib.metadata import entry_points

import pytest

from meshot import evaluate, read_mesh, write_mesh
from meshot.cli import main
from meshot.mesh.shapes.solids import icosphere

FEW = ["--points", "2000", "--emd-points", "200"]


@pytest.fixture
def pair(tmp_path):
    paths = [str(tmp_path / "predicted.ply"), str(tmp_path / "target.obj")]
    for path, radius in zip(paths, (38.0, 40.0), strict=True):
        write_mesh(path, icosphere(2, radius))
    return paths


def test_evaluate_prints_and_writes_what_the_function_finds(pair, tmp_path, capsys):
    assert main(["evaluate", *pair, *FEW, "--seed", "3", "--json", str(tmp_path / "found.json")]) == 0
    found = evaluate(*map(read_mesh, pair), n_points=2000, seed=3, n_emd_points=200)
    assert capsys.readouterr().out == f"{found}\n"
    assert json.loads((tmp_path / "found.json").read_text()) == found.as_dict()


def test_definitions_and_blur(pair, capsys):
    assert main(["evaluate", *pair, *FEW, "--definitions", "--emd-blur", "5"]) == 0
    assert "blur of 5.0 mm between 200 points" in capsys.readouterr().out


def test_what_will_not_do_is_one_line_and_status_2(pair, tmp_path, capsys):
    (tmp_path / "broken.ply").write_bytes((tmp_path / "predicted.ply").read_bytes()[:300])
    for wrong in (["no_such_file.ply", pair[1]], [str(tmp_path / "broken.ply"), pair[1]], [*pair, "--points", "0"]):
        assert main(["evaluate", *wrong]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith("meshot: ")
        assert said.err.count("\n") == 1


def test_a_warning_goes_to_stderr(pair, tmp_path, capsys):
    aside = str(tmp_path / "aside.ply")
    write_mesh(aside, icosphere(2, 40.0, centre=(60.0, 0.0, 0.0)))
    assert main(["evaluate", pair[0], aside, *FEW]) == 0
    assert "meshot: warning: the boxes" in capsys.readouterr().err


def test_help_says_what_it_is_not_for(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", "--help"])
    assert ended.value.code == 0
    assert "Not for clinical use" in capsys.readouterr().out


def test_the_command_is_installed_by_its_name():
    (command,) = entry_points(group="console_scripts", name="meshot")
    assert command.load() is main
