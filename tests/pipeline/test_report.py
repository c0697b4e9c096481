"""``meshot reconstruct`` as a user meets it: files, page, folders in the way, bad scans."""

import dataclasses
import inspect
import json
import os
import re
import shutil

import matplotlib.image
import nibabel
import numpy as np
import pytest

from bright_head import CENTRES, bright_template, write_bright_weights
from browser import offline_browser, watched_page
from meshot.cli import main
from meshot.mesh.geometry import vertex_normals
from meshot.mesh.io import read_mesh
from meshot.metrics.distances import vertex_distances
from meshot.pipeline import load_networks, page as reconstruction_pictures, reconstruction, report as written
from meshot.pipeline.page import _cell
from meshot.pipeline.quality import QualityWarning
from meshot.study import StudySettings, many_visits
from meshot.view import display
from meshot.volume.io import write_volume
from meshot.volume.volume import centre_ras
from preflight import browser as browser_path
from refusals import refuses

SURFACES = [
    f"{side}.{name}{suffix}" for side in ("lh", "rh") for name in ("white", "initial") for suffix in written.FORMATS
]
OTHERS = [
    "report.html", "report.json", "slices.webp", "timing.json", "to_standard.json", "to_standard.lta",
    "to_standard.txt", "white_matter.nii.gz",
]  # fmt: skip
NAME = "<one & only>.nii.gz"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reconstruct")
    write_bright_weights(folder / "weights")
    write_volume(folder / NAME, bright_template())
    return folder


@pytest.fixture(scope="module")
def context():
    with offline_browser(browser_path()) as found:
        yield found


@pytest.fixture(autouse=True)
def small_template(monkeypatch):
    monkeypatch.setattr(reconstruction, "mni152_t1", bright_template)


def own_weights(place):
    weights = place / "weights"
    return ["--system", "ddot", "--weights", str(weights), "--segmentation", str(weights / "segmentation.safetensors")]


def words(place, out, *more):
    return ["reconstruct", str(place / NAME), "-o", str(place / out), *own_weights(place), *more]


@pytest.fixture(scope="module")
def found():
    """The reconstruction that :func:`made` wrote."""
    return []


@pytest.fixture(scope="module")
def made(place, found):
    def kept(*arguments):
        found.append(reconstruction.reconstruct(*arguments))
        return found[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reconstruction, "mni152_t1", bright_template)
        patch.setattr(written, "reconstruct", kept)
        assert main(words(place, "out")) == 0
    return place / "out"


@pytest.fixture
def quick(made, found, monkeypatch):
    """For what happens around a reconstruction: the one that was made, and a single slice."""
    monkeypatch.setattr(written, "reconstruct", lambda *_: found[0])
    monkeypatch.setattr(reconstruction_pictures, "_CUTS", (("axial", 0.5),))


def test_everything_is_there_and_nothing_else(made, place):
    assert sorted(f.name for f in made.iterdir()) == sorted(SURFACES + OTHERS)
    assert not list(place.glob(".writing*"))


def test_all_formats_hold_the_same_surface_where_the_scanner_saw_it(made):
    for side, short in (("left", "lh"), ("right", "rh")):
        for name in ("white", "initial"):
            one, *others = (read_mesh(made / f"{short}.{name}{suffix}") for suffix in written.FORMATS)
            for other in others:
                np.testing.assert_allclose(other.vertices, one.vertices, atol=1e-4)
                assert np.array_equal(other.faces, one.faces)
        middle = read_mesh(made / f"{short}.initial").vertices.mean(dim=0)
        np.testing.assert_allclose(middle, CENTRES[side], atol=0.5)
        header = nibabel.freesurfer.read_geometry(made / f"{short}.white", read_metadata=True)[2]
        np.testing.assert_allclose(header["cras"], centre_ras(bright_template()), atol=1e-6)


def test_the_numbers_are_those_of_the_files(made):
    report = json.loads((made / "report.json").read_text(encoding="utf-8"))
    assert report["scan"]["name"] == NAME
    assert report["system"] == "ddot"
    assert len(report["weights"]) == 3
    assert {"commit", "versions", "date", "machine"} <= set(report)
    for side, short in (("left", "lh"), ("right", "rh")):
        white, initial = read_mesh(made / f"{short}.white"), read_mesh(made / f"{short}.initial")
        numbers = report["surfaces"][side]
        assert numbers["final"]["n_faces"] == len(white.faces)
        assert (numbers["final"]["euler_number"], numbers["final"]["n_self_intersecting_faces"]) == (2, 0)
        distances = vertex_distances(white, initial)
        found = numbers["distance_from_initial_mm"]
        assert found["mean"] == pytest.approx(distances.mean(), abs=1e-3)
        assert found["percentile_95"] == pytest.approx(np.percentile(distances, 95), abs=1e-3)
        assert 0.5 < found["mean"] < found["percentile_95"] < found["largest"] < 2.2
        assert numbers["final"]["volume_cm3"] == pytest.approx(4 / 3 * np.pi * 3.2**3, rel=0.05)
    timing = json.loads((made / "timing.json").read_text(encoding="utf-8"))
    assert timing == report["seconds"]
    assert list(timing["processor"])[-2:] == ["surfaces and numbers", "pictures"]
    assert len(timing["clock"]) == 8


def test_the_transform_leads_to_the_standard_space_and_back(made):
    transform = json.loads((made / "to_standard.json").read_text(encoding="utf-8"))
    matrix = np.array(transform["matrix"])
    moved = [read_mesh(made / f"lh.{name}").vertices.numpy() for name in ("white", "initial")]
    # In the standard space the flow of these weights goes up by 2 mm.
    np.testing.assert_allclose(
        (moved[0] - moved[1]) @ matrix[:3, :3].T, np.tile([0, 0, 2.0], (len(moved[0]), 1)), atol=1e-3
    )
    assert NAME in transform["from"]


def test_the_overview_has_six_squares_with_the_outline_of_the_result(made):
    image = matplotlib.image.imread(made / "slices.webp")[..., :3].astype(float)
    assert image.shape == (480, 720, 3)
    for row in range(2):
        for column in range(3):
            square = image[240 * row : 240 * (row + 1), 240 * column : 240 * (column + 1)]
            # The line is blue; everything else is grey.
            blue = (square[..., 2] - square[..., 0] > 60).mean()
            assert 0.002 < blue < 0.05
            assert square[:5, :5].max() < 20


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1280, "light")])
def test_the_page_is_whole_in_itself(made, context, width, scheme):
    with watched_page(context, made / "report.html") as (page, troubles):
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        assert all(page.eval_on_selector_all("img", "e => e.map(x => x.alt.length > 20 && x.naturalWidth > 100)"))
        assert page.locator(".slices img").count() == 6
        assert NAME in page.locator("h1").text_content()
        assert "Not for clinical use" in page.locator("header").text_content()
        ground, text = page.evaluate(
            "() => [getComputedStyle(document.body)].flatMap(s => [s.backgroundColor, s.color])"
        )
        dark = [sum(map(int, colour[4:-1].split(","))) < 384 for colour in (ground, text)]
        assert dark == ([True, False] if scheme == "dark" else [False, True])
        page.locator(".surface-scene .start").click()
        page.wait_for_selector(".surface-scene canvas")
        assert troubles == []


def test_the_page_says_what_the_numbers_say(made, context):
    report = json.loads((made / "report.json").read_text(encoding="utf-8"))
    with watched_page(context, made / "report.html") as (page, _):
        text = page.locator("main").text_content()
        rows = {r.split("\t")[0]: r.split("\t")[1:] for r in page.locator("tr").all_inner_texts()}
    assert rows["Euler number χ (a sphere has 2)"] == ["2"] * 4
    assert rows["self-intersecting faces"] == ["0"] * 4
    assert rows["volume inside (cm³)"][1] == f"{report['surfaces']['left']['final']['volume_cm3']:.3g}"
    assert all(warning in text for warning in report["warnings"])
    assert "by <hand>" in text


def test_the_page_lists_the_files_that_are_there(made):
    text = (made / "report.html").read_text(encoding="utf-8").partition("Files beside this page")[2]
    lines = [re.sub("<.*?>", "", line).strip() for line in re.findall(r"<li>(.*?)</li>", text, re.DOTALL)]
    names = [name.partition(":")[0] for line in lines for name in line.partition(": ")[0].split(", ")]
    assert sorted(names) == sorted({f.name for f in made.iterdir()} - {"report.html"})
    assert all(": " in line for line in lines)


def test_the_list_of_files_leads_from_the_folder_of_the_page(tmp_path):
    for name in ("surf/lh.white", "mri/orig.mgz", "report/report.json", "report/report.html", "other.xyz"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    found = {name: about for names, about in written.files_beside(tmp_path, tmp_path / "report") for name in names}
    assert list(found) == ["../surf/lh.white", "../mri/orig.mgz", "report.json", "../other.xyz"]
    assert "surface RAS" in found["../surf/lh.white"]
    assert found["../other.xyz"] == ""


def test_a_header_that_contradicts_itself_is_a_warning_or_refused(place, quick, tmp_path, capsys):
    image = nibabel.load(place / NAME)
    image.header["pixdim"][1:4] = 1
    image.header["qform_code"] = 0
    nibabel.Nifti1Image(np.asarray(image.dataobj), None, image.header).to_filename(tmp_path / "a.nii")
    command = ["reconstruct", str(tmp_path / "a.nii"), "-o", str(tmp_path / "out"), *own_weights(place)]
    assert main([*command, "--strict"]) == 3
    assert "by its pixdim; the sform is used (file). Without --strict" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main(command) == 0
    assert "meshot: warning: a.nii: voxels have" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["warning_names"][0] == "file"


def test_warnings_stand_out_and_reach_the_command_line(place, made, monkeypatch, capsys):
    monkeypatch.setattr(reconstruction, "scan_warnings", lambda *_: [QualityWarning("scale", "it <looks> odd", 2.5)])
    assert main(words(place, "odd", "--initial-only")) == 0
    said = capsys.readouterr()
    assert "meshot: warning: it <looks> odd" in said.err
    report = json.loads((place / "odd" / "report.json").read_text(encoding="utf-8"))
    assert dict(zip(report["warning_names"], report["warning_values"], strict=True))["scale"] == 2.5
    assert "Not for clinical use" in said.out
    page = (place / "odd" / "report.html").read_text(encoding="utf-8")
    assert "it &lt;looks&gt; odd" in page
    assert "the initial surfaces are the result" in page
    assert "crossed after the flow" not in page
    assert (place / "odd" / "lh.white").read_bytes() == (place / "odd" / "lh.initial").read_bytes()


def test_a_strict_reconstruction_stops_at_a_warning(place, monkeypatch, capsys):
    monkeypatch.setattr(reconstruction, "volume_warnings", lambda *_: [])
    monkeypatch.setattr(reconstruction, "scan_warnings", lambda *_: [QualityWarning("scale", "it looks odd")])
    with monkeypatch.context() as patch:
        patch.setattr(reconstruction, "placed_white_matter", None)  # no network sees the scan
        assert main(words(place, "strict", "--initial-only", "--strict")) == 3
    assert "meshot: it looks odd (scale). Without --strict" in capsys.readouterr().err
    assert not (place / "strict").exists()
    monkeypatch.setattr(reconstruction, "scan_warnings", lambda *_: [])
    monkeypatch.setattr(
        reconstruction, "surface_warnings", lambda side, *_: [QualityWarning("scale", f"so does the {side}")]
    )
    assert main(words(place, "strict", "--initial-only", "--strict")) == 3
    assert "so does the left; so does the right (scale, scale)." in capsys.readouterr().err
    assert not (place / "strict").exists()


def test_what_lies_outside_the_brain_mask_is_left_out(place, made, capsys):
    head = bright_template()
    mask = head.with_data((head.data > 0).astype(np.float32))
    ball = head.data.copy()
    ball[:6, :6, :6] = 1  # bright as white matter, outside the mask
    write_volume(place / "with_ball.nii.gz", head.with_data(ball))
    write_volume(place / "mask.nii.gz", mask)
    scan = ["reconstruct", str(place / "with_ball.nii.gz"), *own_weights(place), "--initial-only"]
    assert main([*scan, "-o", str(place / "masked"), "--brain-mask", str(place / "mask.nii.gz")]) == 0
    assert json.loads((place / "masked" / "report.json").read_text(encoding="utf-8"))["brain_mask"] == "mask.nii.gz"
    masked, alone = read_mesh(place / "masked" / "lh.white"), read_mesh(made / "lh.initial")  # without the ball
    assert np.array_equal(masked.vertices, alone.vertices)
    assert main([*scan, "-o", str(place / "third"), "--brain-mask", str(place / "no_such.nii.gz")]) == 2


def test_without_opengl_the_page_says_so(place, quick, monkeypatch):
    monkeypatch.setattr(display, "usable_window", lambda: None)
    assert main(words(place, "plain")) == 0
    page = (place / "plain" / "report.html").read_text(encoding="utf-8")
    assert "surfaces cannot be drawn" in page
    assert page.count("<img") == 1


def last_line(capsys) -> str:
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err.splitlines()[-1]


def test_a_folder_in_the_way_is_kept_unless_it_is_an_earlier_reconstruction(place, made, quick, capsys):
    before = {f.name: f.stat().st_mtime_ns for f in made.iterdir()}
    assert main(words(place, "out")) == 2
    assert "or replace it with --overwrite" in last_line(capsys)
    assert {f.name: f.stat().st_mtime_ns for f in made.iterdir()} == before
    precious = place / "precious"
    precious.mkdir()
    (precious / "thesis.txt").write_text("years")
    assert main(words(place, "precious", "--overwrite")) == 2
    assert "holds no reconstruction" in last_line(capsys)
    assert (precious / "thesis.txt").read_text(encoding="utf-8") == "years"
    again = place / "again"
    again.mkdir()
    for name in ("report.json", "report.html", "left_over"):
        (again / name).write_text("old")
    assert main(words(place, "again", "--overwrite")) == 0
    assert sorted(f.name for f in again.iterdir()) == sorted(SURFACES + OTHERS)


def test_a_failure_on_the_way_leaves_nothing(place, quick, monkeypatch, capsys):
    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr(written, "reconstruction_page", fail)
    before = sorted(place.iterdir())
    assert main(words(place, "half")) == 2
    assert last_line(capsys).endswith("meshot: no space left")
    assert sorted(place.iterdir()) == before


def save(path, data, affine):
    image = nibabel.Nifti1Image(data, None)
    if affine is not None:
        image.header.set_sform(affine, 1)
    image.header["qform_code"] = 0
    nibabel.save(image, path)


GOOD = np.random.default_rng(0).normal(50, 5, (12, 13, 14)).astype(np.float32)
PLACE = np.diag([4.0, 4.0, 4.0, 1.0])


@pytest.mark.parametrize(
    ("data", "affine", "why"),
    [
        (np.full((12, 13, 14), 7, np.float32), PLACE, "7.0 everywhere"),
        (np.where(GOOD > 60, np.nan, GOOD), PLACE, "NaN or infinite"),
        (np.stack([GOOD, GOOD], axis=-1), PLACE, "three axes are needed"),
        (GOOD, None, "neither sform nor qform"),
        (GOOD, np.diag([4.0, 4.0, 0.0, 1.0]), "NaN, zeros or no volume"),
        (None, None, "does not exist"),
        (b"", None, "not a whole image"),
        (b"half", None, "not a whole image"),
    ],
    ids=["constant", "nan", "4D", "no affine", "flat affine", "absent", "empty file", "truncated"],
)
def test_bad_scans_end_in_one_line_and_leave_nothing(place, tmp_path, capsys, data, affine, why):
    path = tmp_path / "scan.nii.gz"
    if isinstance(data, bytes):
        path.write_bytes((place / NAME).read_bytes()[:-300] if data else b"")
    elif data is not None:
        save(path, data, affine)
    assert main(["reconstruct", str(path), "-o", str(tmp_path / "out"), *own_weights(place)]) == 2
    line = last_line(capsys)
    assert "meshot: " in line
    assert why in line
    assert [f.name for f in tmp_path.iterdir() if f != path] == []


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (["--system", "freehand"], "there is no system 'freehand'; known are classical, cortexode, cor"),
        (["--threads", "0"], "threads is 0"),
        (["--weights", "/nowhere"], "/nowhere/left_white.safetensors is missing; ddot needs left_white, right_white"),
    ],
)
def test_bad_choices_end_in_one_line(place, capsys, more, why):
    assert main(words(place, "never", *more)) == 2
    assert why in last_line(capsys)
    assert not (place / "never").exists()


def test_numbers_on_the_page_have_no_exponents():
    assert [_cell(value) for value in (1138.4, 174540, 361.21, 0)] == ["1\u202f138", "174\u202f540", "361", "0"]


def test_names_that_are_no_utf8(place, quick, capsys):
    """A scan and a folder named in Latin-1: everything is written, and the report says U+FFFD for the byte."""
    scan, out = place / os.fsdecode(b"caf\xe9.nii.gz"), place / os.fsdecode(b"sal\xe9")
    shutil.copy(place / NAME, scan)
    assert main(["reconstruct", str(scan), "-o", str(out), *own_weights(place)]) == 0
    assert json.loads((out / "report.json").read_text(encoding="utf-8"))["scan"]["name"] == "caf\ufffd.nii.gz"
    assert "caf\ufffd.nii.gz" in (out / "report.html").read_text(encoding="utf-8")
    assert "sal\ufffd" in capsys.readouterr().out


def test_a_pial_surface_gives_thickness_on_the_page(made, found, quick, place, monkeypatch, capsys):
    """The pial balls are the white ones, larger by 2 mm."""
    seen = []
    monkeypatch.setattr(
        reconstruction_pictures, "interactive", lambda *given, **named: seen.append((given, named)) or View
    )
    pial = {}
    for side, surface in found[0].surfaces.items():
        outwards = vertex_normals(surface.final)
        pial[side] = dataclasses.replace(
            surface, pial=surface.final.with_vertices(surface.final.vertices + 2 * outwards)
        )
    thick = dataclasses.replace(found[0], surfaces=pial)
    monkeypatch.setattr(written, "reconstruct", lambda *_: thick)
    assert main(words(place, "thick")) == 0
    # Two balls are no brain: their lobes are doubted.
    report = json.loads((place / "thick" / "report.json").read_text(encoding="utf-8"))
    assert "shape" in report["doubts"]["left"]["occipital"]
    assert "unusual, look there first: left frontal (" in capsys.readouterr().out
    assert re.search(r"<td>[a-z, ]*shape</td>", (place / "thick" / "report.html").read_text(encoding="utf-8"))
    report = json.loads((place / "thick" / "report.json").read_text(encoding="utf-8"))
    page = (place / "thick" / "report.html").read_text(encoding="utf-8")
    for side in ("left", "right"):
        numbers = report["surfaces"][side]
        assert numbers["pial"]["mean_thickness_mm"] == pytest.approx(2, abs=0.1)
        between = numbers["pial"]["volume_cm3"] - numbers["final"]["volume_cm3"]
        assert numbers["pial"]["cortex_volume_cm3"] == pytest.approx(between, rel=1e-3)
        assert nibabel.freesurfer.read_morph_data(place / "thick" / f"{side[0]}h.thickness").mean() > 1.8
    assert "mean thickness of the cortex (mm)" in page
    assert "coloured by the thickness of the cortex" in page
    assert "how far each position is from the initial surface" not in page
    assert "the thickness at every vertex of the white surface" in page
    ((_, colours), named) = seen[0]
    assert named["label"] == "thickness of the cortex"
    assert colours["left"].mean() == pytest.approx(2, abs=0.1)


class View:
    """What stands for an interactive view."""

    html = "<p>surfaces</p>"


@pytest.mark.parametrize("more", [[], ["--white-only"]])
def test_pial_surfaces_are_left_out_if_asked_for(tmp_path, monkeypatch, more):
    """Of one scan, and of a study."""
    seen = []

    def load(*given, **named):
        seen.append(inspect.signature(load_networks).bind(*given, **named).arguments.get("white_only", False))
        raise ValueError("enough")

    monkeypatch.setattr("meshot.pipeline.load_networks", load)
    monkeypatch.setattr("meshot.study.many_visits.load_networks", load)
    scan = tmp_path / "T1.nii.gz"
    assert main(["reconstruct", str(scan), "-o", str(tmp_path / "out"), *more]) == 2
    refuses("enough", many_visits._networks.__wrapped__, StudySettings(white_only=bool(more)))
    assert seen == [bool(more)] * 2
