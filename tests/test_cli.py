import argparse
import csv
import hashlib
import json
import re
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import meshot
from meshot import evaluate, read_mesh, write_mesh
from meshot.cli import main, make_parser
from meshot.cli.common import known_systems
from meshot.mesh import read_vertex_data, write_carried
from meshot.mesh.shapes import icosphere
from meshot.systems import system_names

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
    written = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert written["metrics"] == found.as_dict()
    assert written["version"] == meshot.__version__
    assert written["settings"] == {"points": 2000, "emd_points": 200, "emd_blur": None, "seed": 3, "align": False}
    for name, path in zip(("predicted", "target"), pair, strict=True):
        assert written["inputs"][name] == {"path": path, "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest()}


def test_a_dash_is_stdout_and_nothing_else_is_there(pair, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["evaluate", *pair, *FEW, "--json", "-", "--definitions", "--emd-blur", "5"]) == 0
    said = capsys.readouterr().out
    assert json.loads(said)["metrics"]["assd"]["unit"] == "mm"
    assert "blur of 5.0 mm between 200 points" in said
    assert not (tmp_path / "-").exists()


def test_points_bound_the_points_of_the_emd(pair, capsys):
    assert main(["evaluate", *pair, "--points", "300", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["settings"]["emd_points"] == 300


def test_a_table_of_pairs_is_answered_by_a_table(pair, tmp_path, capsys):
    names = [Path(path).name for path in pair]
    (tmp_path / "pairs.tsv").write_text("subject\tpredicted\ttarget\n" + f"a\t{names[0]}\t{names[1]}\n" * 2)
    words = ["evaluate", "--pairs", str(tmp_path / "pairs.tsv"), *FEW, "--seed", "3"]
    assert main([*words, "--tsv", str(tmp_path / "found.tsv")]) == 0
    capsys.readouterr()
    assert main(words) == 0
    assert capsys.readouterr().out == (tmp_path / "found.tsv").read_text(encoding="utf-8")
    rows = list(csv.DictReader((tmp_path / "found.tsv").read_text(encoding="utf-8").splitlines(), dialect="excel-tab"))
    found = evaluate(*map(read_mesh, pair), n_points=2000, seed=3, n_emd_points=200)
    assert len(rows) == 2
    assert float(rows[1]["assd"]) == found.assd.value
    assert float(rows[1]["assd_floor"]) == found.assd.floor
    assert (rows[0]["predicted"], rows[0]["seed"], rows[0]["version"]) == (pair[0], "3", meshot.__version__)


#: In mm. Files keep coordinates as float32, up to 4e-6 mm off at 60 mm, and ICP stops at steps of 1e-6 mm.
ALIGNED = 1e-3


def folders_of_subjects(tmp_path):
    """A SUBJECTS_DIR with an ellipsoid, and a folder of meshot with the same surface in another position, and more."""
    mesh = icosphere(3, 40.0)
    mesh = mesh.with_vertices(mesh.vertices * mesh.vertices.new_tensor([1.0, 1.4, 1.2]))
    (tmp_path / "subjects" / "sub-01" / "surf").mkdir(parents=True)
    write_mesh(tmp_path / "subjects" / "sub-01" / "surf" / "lh.white", mesh, (5.0, -3.0, 2.0))
    turn = Rotation.from_euler("z", 5, degrees=True).as_matrix()
    for subject in ("sub-01", "sub-02"):
        (tmp_path / "ours" / subject).mkdir(parents=True)
        moved = mesh.vertices @ mesh.vertices.new_tensor(turn).T + mesh.vertices.new_tensor([3.0, 2.0, 1.0])
        write_mesh(tmp_path / "ours" / subject / "lh.white.ply", mesh.with_vertices(moved))
    return [str(tmp_path / name) for name in ("ours", "subjects")]


def test_folders_of_subjects_are_paired_and_aligned(tmp_path, capsys):
    folders = folders_of_subjects(tmp_path)
    assert main(["evaluate", *folders, *FEW]) == 2
    assert "sub-02 left is only in the reconstructed folder" in capsys.readouterr().err
    assert main(["evaluate", *folders, *FEW, "--common"]) == 0
    said = capsys.readouterr()
    assert "sub-02 left is only in the reconstructed folder: it is left out" in said.err
    (row,) = csv.DictReader(said.out.splitlines(), dialect="excel-tab")
    assert row["target"].endswith("subjects/sub-01/surf/lh.white")
    assert float(row["assd"]) > 1
    assert "icp_residue_mm" not in row
    assert main(["evaluate", *folders, *FEW, "--common", "--align"]) == 0
    (row,) = csv.DictReader(capsys.readouterr().out.splitlines(), dialect="excel-tab")
    assert 0 <= float(row["icp_residue_mm"]) < ALIGNED
    assert float(row["assd"]) < ALIGNED
    assert main(["evaluate", folders[0], row["target"], *FEW]) == 2
    assert "lh.white is no folder" in capsys.readouterr().err
    write_mesh(tmp_path / "ours" / "sub-01" / "lh.white.ply", icosphere(2, 40.0, centre=(900.0, 0.0, 0.0)))
    assert main(["evaluate", *folders, *FEW, "--common"]) == 2
    assert re.search(r"do not overlap.* \(files \S+/sub-01/lh\.white\.ply and \S+lh\.white\)", capsys.readouterr().err)
    assert main(["evaluate", *folders, *FEW, "--surface", "pial"]) == 2
    assert "holds no surface pial" in capsys.readouterr().err


def test_two_surfaces_are_aligned(tmp_path, capsys):
    ours, theirs = map(Path, folders_of_subjects(tmp_path))
    files = [str(ours / "sub-01" / "lh.white.ply"), str(theirs / "sub-01" / "surf" / "lh.white")]
    assert main(["evaluate", *files, *FEW, "--align", "--json", str(tmp_path / "found.json")]) == 0
    assert "aligned by ICP: turned by 5 degrees, residue " in capsys.readouterr().out
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert found["settings"]["align"] is True
    assert found["icp_residue_mm"] < ALIGNED
    assert found["metrics"]["assd"]["value"] < ALIGNED


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "two surfaces"),
        (["one.ply"], "two surfaces"),
        (["--pairs", "pairs.tsv"], "columns predicted and target"),
        (
            ["one.ply", "two.ply", "--surface", "pial"],
            "--surface and --common choose among the surfaces of two folders",
        ),
        (["one.ply", "two.ply", "--common"], "leave these options out, or give two folders"),
        (["--pairs", "pairs.tsv", "--common"], "leave these options out, or give two folders"),
    ],
)
def test_what_is_not_pairs_is_refused(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    Path("pairs.tsv").write_text("predicted,target\na.ply,b.ply\n")
    assert main(["evaluate", *words]) == 2
    assert said in capsys.readouterr().err


def test_the_version_is_said(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"meshot {meshot.__version__}\n"


def test_what_will_not_do_is_one_line_and_status_2(pair, tmp_path, capsys):
    (tmp_path / "broken.ply").write_bytes((tmp_path / "predicted.ply").read_bytes()[:300])
    for wrong in (
        ["no_such_file.ply", pair[1], *FEW],
        [str(tmp_path / "broken.ply"), pair[1], *FEW],
        [*pair, "--points", "0"],
        [*pair, *FEW, "--json", "-", "--tsv", "-"],
    ):
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


def parsers():
    """The parser of each command, by its name."""
    (commands,) = (action for action in make_parser()._actions if isinstance(action, argparse._SubParsersAction))
    return commands.choices


@pytest.mark.parametrize("name", parsers())
def test_help_ends_with_commands_that_parse(name):
    command = parsers()[name]
    examples = [line.split() for line in command.format_help().splitlines() if line.startswith("  meshot ")]
    assert examples
    for program, *words in examples:
        assert program == "meshot"
        assert words[0] == name
        make_parser().parse_args(words)


@pytest.mark.parametrize("name", parsers())
def test_help_names_every_default(name):
    silent = (None, False, [])
    for action in parsers()[name]._actions:
        assert "default" in action.help or action.default in silent or action.dest == "help", action.dest


def test_the_command_is_installed_by_its_name():
    (command,) = entry_points(group="console_scripts", name="meshot")
    assert command.load() is main


#: Loads in a second or more, or reads and draws what losses have nothing to do with.
SLOW = {"torch", "numpy", "scipy", "numba", "yaml"}
NOT_FOR_LOSSES = {
    "ot", "geomloss", "torchdiffeq", "sklearn", "pandas", "trimesh", "igl", "nibabel", "nilearn", "vtk", "vtkmodules",
    "pyvista", "matplotlib", "skimage", "SimpleITK",
}  # fmt: skip
LOSS = """
import torch, meshot
points = torch.rand(5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
source, target = meshot.DiscreteMeasure(points), meshot.DiscreteMeasure(points + 1)
meshot.sliced_wasserstein(source, target, meshot.quasi_directions(4, 3)).item()
"""


@pytest.mark.parametrize(
    ("code", "unwanted"),
    [
        ("import meshot", SLOW | NOT_FOR_LOSSES),
        ("from meshot.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass", SLOW | NOT_FOR_LOSSES),
        ("from meshot.cli import main\ntry: main(['train', '--help'])\nexcept SystemExit: pass", SLOW | NOT_FOR_LOSSES),
        (LOSS, NOT_FOR_LOSSES),
    ],
)
def test_what_is_not_needed_is_not_loaded(code, unwanted):
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules, sep='\\n', file=sys.stderr)"],
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    loaded = set(done.stderr.split())
    assert "meshot" in loaded
    assert loaded & unwanted == set()


def test_the_package_runs_as_a_module():
    done = subprocess.run([sys.executable, "-m", "meshot", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"meshot {meshot.__version__}\n"


def test_systems_are_named_without_loading_them():
    assert known_systems() == system_names()
    for command in ("train", "reconstruct"):
        text = " ".join(make_parser()._subparsers._group_actions[0].choices[command].format_help().split())
        assert ", ".join(known_systems()) in text


def test_the_shell_completes(capsys):
    """Bash itself is asked what it would offer."""
    assert main(["completion"]) == 0
    script = capsys.readouterr().out
    offered = {
        "meshot ev": "evaluate",
        "meshot train d": "ddot deepcsr",
        "meshot reconstruct x --system cort": "cortexode corticalflow",
        "meshot evaluate --com": "--common",
        "meshot reconstruct --layout b": "bids",
        "meshot evaluate x": "",
    }
    for line, expected in offered.items():
        words = line.split()
        asks = f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _meshot; echo ${{COMPREPLY[@]}}"
        done = subprocess.run(["bash", "-c", f"{script}\n{asks}"], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == expected, line


def test_what_trimesh_reads_otherwise_is_not_carried(tmp_path):
    """A file of 3D Slicer in LPS: trimesh does not turn it, so colours would come to lie on the wrong side."""
    ball = icosphere(1, 1.0).to_trimesh()
    ball.vertices += [5, 0, 0]
    ball.visual.vertex_colors = np.full((len(ball.vertices), 4), 9, np.uint8)
    text = ball.export(file_type="ply", encoding="ascii")
    (tmp_path / "a.ply").write_bytes(text.replace(b"element vertex", b"comment SPACE=LPS\nelement vertex", 1))
    files = tmp_path / "b.ply", tmp_path / "a.ply"
    assert not write_carried(*files, read_mesh(files[1]), lambda points: points)
    (tmp_path / "a.ply").write_bytes(text)
    assert write_carried(*files, read_mesh(files[1]), lambda points: points)


def test_deform_keeps_what_the_vertices_carry(tmp_path, capsys):
    """A sphere with colours and one with a texture, whose seam repeats vertices, become larger spheres."""
    ball = icosphere(2, 1.0).to_trimesh()
    ball.visual.vertex_colors = np.random.default_rng(0).integers(0, 255, (len(ball.vertices), 4))
    ball.export(tmp_path / "coloured.ply")
    textured = trimesh.creation.uv_sphere(count=[12, 12])
    seam = np.arange(0, len(textured.vertices), 3)
    vertices = np.vstack([textured.vertices, textured.vertices[seam]])
    uv = np.random.default_rng(0).random((len(vertices), 2))
    trimesh.Trimesh(vertices, textured.faces, visual=trimesh.visual.TextureVisuals(uv), process=False).export(
        tmp_path / "textured.glb"
    )
    write_mesh(tmp_path / "target.ply", icosphere(2, 1.2))
    quick = ["--iterations", "60", "--detail", "0.3"]
    for name in ("coloured.ply", "textured.glb"):
        words = ["deform", str(tmp_path / name), str(tmp_path / "target.ply"), "-o", str(tmp_path / f"to_{name}")]
        assert main([*words, *quick]) == 0
        before, after = (trimesh.load(tmp_path / each, process=False, force="mesh") for each in (name, f"to_{name}"))
        assert np.array_equal(before.faces, after.faces)
        radii = np.linalg.norm(after.vertices, axis=1)
        assert radii[np.unique(after.faces)] == pytest.approx(1.2, abs=0.05)
        if name == "coloured.ply":
            assert np.array_equal(before.visual.vertex_colors, after.visual.vertex_colors)
        else:
            assert np.array_equal(before.visual.uv, after.visual.uv)
    said = capsys.readouterr()
    assert re.search(r"mean distance from the target: 0\.\d+ before, 0\.0\d+ after\n\d+ vertices in", said.out)
    assert main(["deform", *words[1:4], str(tmp_path / "gone" / "x.ply"), *quick]) == 2
    assert "gone is no folder; make it first" in capsys.readouterr().err
    write_mesh(tmp_path / "thick.vtp", icosphere(2), vertex_data={"thickness": icosphere(2).vertices[:, 0]})
    words[1:] = [str(tmp_path / "thick.vtp"), words[2], "-o", str(tmp_path / "thick.surf.gii")]
    assert main([*words, *quick]) == 0
    assert read_vertex_data(tmp_path / "thick.surf.gii")["thickness"].equal(icosphere(2).vertices[:, 0].float())
    assert main(["deform", str(tmp_path / "target.ply"), *words[2:4], str(tmp_path / "plain.off"), *quick]) == 0
    assert len(read_mesh(tmp_path / "plain.off").vertices) == len(icosphere(2).vertices)
    capsys.readouterr()
    assert main(["deform", str(tmp_path / "coloured.ply"), *words[2:4], str(tmp_path / "plain.off"), *quick]) == 0
    assert (
        "plain.off does not hold what coloured.ply has besides: data of vertices: red, green, blue"
        in capsys.readouterr().err
    )
