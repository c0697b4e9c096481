"""S1 is fetched whole or not at all, and surfaces are measured on spheres whose answers are known."""

import io
import tarfile
from pathlib import Path

import pytest
import yaml

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.io import write_mesh
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface
from meshot.provenance import file_digest
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "beside_freesurfer"


@pytest.fixture
def archive(tmp_path):
    """A source distribution with a licence and a scan."""
    file = tmp_path / "toy-1.0.tar.gz"
    with tarfile.open(file, "w:gz") as packed:
        for name, content in (("LICENSE", b"BSD"), ("data/scan.nii.gz", b"scan"), ("setup.py", b"")):
            entry = tarfile.TarInfo(f"toy-1.0/{name}")
            entry.size = len(content)
            packed.addfile(entry, io.BytesIO(content))
    return file


@pytest.fixture
def settings(archive, tmp_path, part, monkeypatch):
    """Settings for the toy, which pip "downloads"."""
    fetch = part("fetch")
    scan = tmp_path / "scan"
    scan.write_bytes(b"scan")
    source = {
        "package": "toy==1.0", "archive_sha256": file_digest(archive), "scan_sha256": file_digest(scan),
        "files": {"LICENSE": "LICENSE", "data/scan.nii.gz": "scan.nii.gz"},
    }  # fmt: skip
    script, config = tmp_path / "fetch.py", {"source": source, "folder": "S1"}
    monkeypatch.setattr(fetch, "__file__", str(script))
    monkeypatch.setattr(fetch, "ROOT", tmp_path)
    monkeypatch.setattr(fetch, "download", lambda package, folder: archive)

    def write(**changes):
        text = yaml.safe_dump(config | {"source": source | changes})
        script.with_name("config.yaml").write_text(text, encoding="utf-8")

    write()
    return write


def test_the_files_are_unpacked_and_taken_once(part, settings, tmp_path, monkeypatch, capsys):
    fetch = part("fetch")
    assert fetch.main() == 0
    assert {file.name: file.read_bytes() for file in (tmp_path / "S1").iterdir()} == {
        "LICENSE": b"BSD", "scan.nii.gz": b"scan",
    }  # fmt: skip
    monkeypatch.setattr(fetch, "download", None)  # is not asked again
    assert fetch.main() == 0
    assert "S1 is in" in capsys.readouterr().out


@pytest.mark.parametrize("what", ["archive_sha256", "scan_sha256"])
def test_another_archive_or_scan_is_refused(part, settings, capsys, what):
    settings(**{what: "0" * 64})
    assert part("fetch").main() == 2
    assert f"{'0' * 64} is expected: the file was cut short, or the index has another one" in capsys.readouterr().err


def test_a_failure_of_pip_is_said(part, tmp_path, monkeypatch):
    fetch = part("fetch")
    commands = []

    class Failed:
        returncode = 1

    monkeypatch.setattr(fetch.subprocess, "run", lambda command, check: commands.append(command) or Failed)
    refuses(r"pip did not fetch toy==1\.0", fetch.download, "toy==1.0", tmp_path)
    assert "--no-binary=toy" in commands[0]


def test_spheres_have_the_measures_of_spheres(part):
    """A sphere of radius 9 inside one of radius 10, whose upper half is the cortex."""
    run, outer = part("run"), icosphere(5, radius=10.0)
    cortex = (outer.vertices[outer.faces].mean(dim=1)[:, 2] > 0).numpy()
    config = {"n_points": 4000, "seed": 0, "beyond_mm": 2.0}
    found = run.compared(icosphere(5, radius=9.0), Surface(outer), cortex, config)
    for place in ("", "_cortex"):
        assert found[f"assd{place}_mm"] == pytest.approx(1, abs=0.01)
        assert found[f"hausdorff90{place}_mm"] == pytest.approx(1, abs=0.01)
        assert found[f"signed{place}_mm"] == pytest.approx(-1, abs=0.01)
        assert found[f"beyond{place}_percent"] == 0
    assert found["area_percent"] == pytest.approx(100 * (0.81 - 1))
    assert found["volume_percent"] == pytest.approx(100 * (0.729 - 1))
    assert found["crossing_percent"] == 0


def test_what_is_far_from_the_cortex_alone_does_not_count_there(part):
    """The lower half is 3 mm off, the upper one, which is cortex, not at all."""
    run, sphere = part("run"), icosphere(5, radius=10.0)
    vertices = sphere.vertices * (1 + 0.3 * (sphere.vertices[:, 2:] < -1))
    cortex = (sphere.vertices[sphere.faces].mean(dim=1)[:, 2] > 0).numpy()
    config = {"n_points": 4000, "seed": 0, "beyond_mm": 2.0}
    found = run.compared(sphere.with_vertices(vertices), Surface(sphere), cortex, config)
    assert found["beyond_percent"] > 30
    assert found["beyond_cortex_percent"] < 1
    assert found["assd_mm"] > 1
    assert found["assd_cortex_mm"] < 0.05


def test_flat_maps_say_what_is_cortex(part, tmp_path):
    sphere = icosphere(2, radius=10.0)
    upper = sphere.faces[(sphere.vertices[sphere.faces][:, :, 2] > -1e-9).all(dim=1)]
    write_mesh(tmp_path / "lh.white.gii", sphere)
    write_mesh(tmp_path / "lh.flat.gii", type(sphere)(sphere.vertices, upper))
    _, cortex = part("run").reference("left", type("Config", (dict,), {"__hash__": object.__hash__})(folder=tmp_path))
    assert int(cortex.sum()) == len(upper)


def test_thickness_of_all_programs_is_by_the_same_formula(part, tmp_path):
    """fsaverage5 as two programs and as the reference; the second has a pial surface that lies half as far away."""
    run = part("run")
    white, pial = (fsaverage5_surface(kind, "left") for kind in ("white", "pial"))
    half = white.with_vertices((white.vertices + pial.vertices) / 2)
    write_mesh(tmp_path / "lh.white.gii", white)
    assert run.peer_surfaces({"peers": {"cat": tmp_path}}, "left") == {}  # without a pial surface
    write_mesh(tmp_path / "lh.pial.gii", half)
    peers = run.peer_surfaces({"peers": {"cat": tmp_path}}, "left")
    row = run.thickness_rows({"package": (white, pial)} | peers | {"reference": (white, pial)}, white, "left")
    assert row["package"] == row["reference"] | {"correlation_of_regions": pytest.approx(1, abs=1e-6)}
    assert len(row["reference"]["regions"]) == 34
    assert 0.4 < row["cat"]["mean_mm"] / row["reference"]["mean_mm"] < 0.6
    assert 0.9 < row["cat"]["correlation_of_regions"] < 1
