"""Folders of surfaces against each other: layouts, pairs, closed forms of spheres, intervals, a page, bad input."""

import csv
import json

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from browser import barriers, offline_browser, watched_page
from meshot import write_mesh
from meshot.cli import main
from meshot.mesh import face_areas, icosphere
from meshot.study import find_surfaces
from meshot.study.comparison import Place, _cell, paired_surfaces
from preflight import browser as browser_path

FEW = ["--points", "2000", "--emd-points", "100"]
RADII = {"sub-01": 40.5, "sub-02": 41.0, "sub-03": 42.5}
REFERENCE = 40.0
SHORT = {"left": "lh", "right": "rh"}
AT = {"left": (-45.0, 0.0, 0.0), "right": (45.0, 0.0, 0.0)}


def sphere(radius: float, side: str):
    return icosphere(3, radius, AT[side])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Three subjects: flat folders as meshot writes them, and a SUBJECTS_DIR with other files in it."""
    ours, theirs = (tmp_path_factory.mktemp(name) / name for name in ("ours", "<b>SUBJECTS_DIR"))
    for i, (subject, radius) in enumerate(RADII.items()):
        for side, short in SHORT.items():
            for suffix in ("", ".surf.gii", ".ply"):
                place = ours / subject / f"{short}.white{suffix}"
                place.parent.mkdir(parents=True, exist_ok=True)
                write_mesh(place, sphere(radius + (side == "left") * 0.5 * i, side))
            place = theirs / subject / "surf" / f"{short}.white"
            place.parent.mkdir(parents=True, exist_ok=True)
            write_mesh(place, sphere(REFERENCE, side), (5.0, -3.0, 2.0))
            (place.parent / f"{short}.white.preaparc").write_text("another file of FreeSurfer")
            (place.parent / f"{short}.white.H").write_text("and another")
    return ours, theirs


@pytest.fixture(scope="module")
def made(folders, tmp_path_factory):
    out = tmp_path_factory.mktemp("table") / "out"
    assert main(["table", *map(str, folders), "-o", str(out), *FEW]) == 0
    return out


def read(path):
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines(), dialect="excel-tab"))


def test_points_bound_the_points_of_the_emd(folders, tmp_path):
    assert main(["table", *map(str, folders), "-o", str(tmp_path / "out"), "--points", "50"]) == 0
    settings = json.loads((tmp_path / "out" / "surfaces.json").read_text(encoding="utf-8"))["meshot"]
    assert (settings["points"], settings["emd_points"]) == (50, 50)


def test_each_layout_is_found(folders, tmp_path):
    ours, theirs = (find_surfaces(folder) for folder in folders)
    assert list(ours) == list(theirs) == [Place(subject, "", side) for subject in RADII for side in SHORT]
    assert all(path.name in ("lh.white", "rh.white") for path in (*ours.values(), *theirs.values()))
    for name in (
        "sub-01/ses-b/anat/sub-01_ses-b_run-1_hemi-L_white.surf.gii",
        "sub-01/ses-b/anat/sub-01_ses-b_run-1_hemi-L_pial.surf.gii",
        "sub-01/ses-b/anat/sub-01_ses-b_run-1_hemi-L_desc-initial_white.surf.gii",
        "sub-02_ses-a/surf/rh.white",
        "sub-03/ses-c/lh.white.ply",
        "lh.white",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = find_surfaces(tmp_path)
    assert list(found) == [
        Place("sub-01", "ses-b", "left"), Place("sub-02", "ses-a", "right"), Place("sub-03", "ses-c", "left")
    ]  # fmt: skip
    assert "desc" not in next(iter(found.values())).name
    assert [str(place) for place in find_surfaces(tmp_path, "pial")] == ["sub-01 ses-b left"]


def test_every_surface_has_its_numbers_and_floors(made):
    rows = read(made / "surfaces.tsv")
    assert [(row["participant_id"], row["session_id"], row["side"]) for row in rows] == [
        (subject, "n/a", side) for subject in RADII for side in SHORT
    ]
    for i, row in enumerate(rows):
        radius = RADII[row["participant_id"]] + (row["side"] == "left") * 0.5 * (i // 2)
        # Concentric icospheres: the distance between their faces is at most that of the spheres, and at least it times
        # the ratio of the inscribed to the circumscribed radius of an icosphere, .99 here.
        assert 0.98 * (radius - REFERENCE) <= float(row["assd"]) <= radius - REFERENCE + 1e-4
        assert float(row["assd_floor"]) < 1e-4
        assert float(row["area"]) == pytest.approx(float(face_areas(icosphere(3, radius)).sum()), rel=1e-5)
        assert float(row["area_floor"]) == pytest.approx(float(face_areas(icosphere(3, REFERENCE)).sum()), rel=1e-5)
    described = json.loads((made / "surfaces.json").read_text(encoding="utf-8"))
    assert set(described) == {*rows[0], "meshot"}
    assert described["assd"]["Units"] == "mm"
    assert described["meshot"]["surface"] == "white"


def test_the_summary_pairs_participants(made):
    surfaces = read(made / "surfaces.tsv")
    rows = {(row["side"], row["metric"]): row for row in read(made / "summary.tsv")}
    assert {side for side, _ in rows} == {"left", "right", "both"}
    for side in ("left", "right", "both"):
        chosen = [row for row in surfaces if side in (row["side"], "both")]
        values, floors = (
            [np.mean([float(r[key]) for r in chosen if r["participant_id"] == subject]) for subject in RADII]
            for key in ("area", "area_floor")
        )
        row = rows[side, "area"]
        interval = stats.ttest_rel(values, floors).confidence_interval(0.95)
        assert float(row["difference"]) == pytest.approx(np.subtract(values, floors).mean(), rel=1e-9)
        assert (float(row["difference_low"]), float(row["difference_high"])) == pytest.approx(tuple(interval), rel=1e-9)
        assert (row["participants"], row["unit"]) == ("3", "mm²")
    assert set(json.loads((made / "summary.json").read_text(encoding="utf-8"))) == set(read(made / "summary.tsv")[0])


def test_the_page_shows_both_tables_and_escapes_names(made):
    with offline_browser(browser_path()) as context, watched_page(context, made / "table.html") as (page, troubles):
        assert "<b>SUBJECTS_DIR" in page.locator("h1").inner_text()
        assert page.locator("h2").all_inner_texts()[:3] == [
            f"{s}: mean over 3 participants" for s in ("Left", "Right", "Both")
        ]
        assert page.locator("table").count() == 4
        assert page.locator("table").last.locator("tbody tr").count() == 6
        for width in (1280, 400):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        cut = "tables => tables.filter((table) => table.offsetWidth > table.parentElement.clientWidth).length"
        assert page.eval_on_selector_all(".means", cut) == 0  # the means are read on a telephone without scrolling
        assert barriers(page) == []
        assert troubles == []


def test_sessions_of_a_participant_count_once(tmp_path, capsys):
    for folder, radius in (("ours", 41.0), ("theirs", 40.0)):
        for session in ("ses-a", "ses-b"):
            place = tmp_path / folder / "sub-01" / session / "lh.white.ply"
            place.parent.mkdir(parents=True)
            write_mesh(place, sphere(radius, "left"))
    words = ["table", *(str(tmp_path / name) for name in ("ours", "theirs", "out"))]
    assert main([*words[:3], "-o", words[3], *FEW]) == 0
    assert "participants: 1;" in capsys.readouterr().out
    rows = read(tmp_path / "out" / "summary.tsv")
    assert {(row["side"], row["participants"], row["mean_low"]) for row in rows} == {("left", "1", "n/a")}


def test_scans_in_different_positions_are_aligned(tmp_path):
    mesh = icosphere(3, 40.0)
    mesh = mesh.with_vertices(mesh.vertices * mesh.vertices.new_tensor([1.0, 1.4, 1.2]))
    turn = mesh.vertices.new_tensor(Rotation.from_euler("z", 0.1).as_matrix())
    for folder, vertices in (("first", mesh.vertices), ("second", mesh.vertices @ turn.T + 2.0)):
        (tmp_path / folder / "sub-01").mkdir(parents=True)
        write_mesh(tmp_path / folder / "sub-01" / "lh.white.ply", mesh.with_vertices(vertices))
    words = ["table", str(tmp_path / "second"), str(tmp_path / "first"), *FEW]
    assert main([*words, "-o", str(tmp_path / "apart")]) == 0
    assert main([*words, "-o", str(tmp_path / "aligned"), "--align"]) == 0
    (apart,), (aligned,) = (read(tmp_path / name / "surfaces.tsv") for name in ("apart", "aligned"))
    assert float(apart["assd"]) > 1
    # Files keep coordinates as float32, up to 4e-6 mm off, and ICP stops at steps of 1e-6 mm.
    assert float(aligned["assd"]) < 1e-3
    assert float(aligned["icp_residue"]) < 1e-3
    assert set(aligned) - set(apart) == {"icp_residue"}
    described = json.loads((tmp_path / "aligned" / "surfaces.json").read_text(encoding="utf-8"))
    assert set(described) == {*aligned, "meshot"}
    said = "first aligned rigidly with its reference"
    pages = [(tmp_path / name / "table.html").read_text(encoding="utf-8") for name in ("apart", "aligned")]
    assert [said in page for page in pages] == [False, True]


def place(folder, subject: str, side: str = "left", radius: float = 40.0, shift: float = 0.0):
    path = folder / subject / f"{SHORT[side]}.white.ply"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_mesh(path, icosphere(2, radius, (shift, 0.0, 0.0)))


def compared(tmp_path, *more) -> int:
    return main(["table", str(tmp_path / "ours"), str(tmp_path / "theirs"), "-o", str(tmp_path / "out"), *FEW, *more])


def test_what_is_in_one_folder_only_is_refused_or_left_out(tmp_path, capsys):
    for subject in ("sub-01", "sub-02"):
        for side in SHORT:
            place(tmp_path / "ours", subject, side)
    place(tmp_path / "theirs", "sub-01", "left")
    place(tmp_path / "theirs", "sub-03", "left")
    assert compared(tmp_path) == 2
    said = capsys.readouterr().err
    assert "sub-01 right is only in the reconstructed folder; sub-02 left is only in the reconstructed folder" in said
    assert "and 1 more; complete the folders, or compare the others with --common" in said
    assert not (tmp_path / "out").exists()
    assert compared(tmp_path, "--common") == 0
    assert "warning: sub-03 left is only in the reference: it is left out" in capsys.readouterr().err
    assert [row["participant_id"] for row in read(tmp_path / "out" / "surfaces.tsv")] == ["sub-01"]
    assert "sub-03 left is only in the reference" in (tmp_path / "out" / "table.html").read_text(encoding="utf-8")


def test_other_spaces_are_refused_by_name(tmp_path, capsys):
    place(tmp_path / "ours", "sub-01")
    place(tmp_path / "theirs", "sub-01", shift=500.0)
    assert compared(tmp_path) == 2
    said = capsys.readouterr().err
    assert "sub-01 left: the surfaces do not overlap" in said
    assert "lh.white.ply" in said
    assert not (tmp_path / "out").exists()


def test_a_doubt_names_its_subject(tmp_path, capsys):
    place(tmp_path / "ours", "sub-07")
    place(tmp_path / "theirs", "sub-07", shift=60.0)
    assert compared(tmp_path) == 0
    assert "warning: sub-07 left: the boxes" in capsys.readouterr().err


def test_folders_that_will_not_do(tmp_path, capsys):
    place(tmp_path / "ours", "sub-01")
    assert compared(tmp_path) == 2
    assert "theirs is no folder" in capsys.readouterr().err
    (tmp_path / "theirs").mkdir()
    assert compared(tmp_path) == 2
    assert "holds no surface white; needed are SUBJECT/surf/lh.white (FreeSurfer)" in capsys.readouterr().err
    place(tmp_path / "theirs", "sub-02")
    assert compared(tmp_path) == 2
    assert "no subject and side is in both folders: the first has sub-01 left" in capsys.readouterr().err
    (tmp_path / "theirs" / "sub-01" / "surf").mkdir(parents=True)
    place(tmp_path / "theirs", "sub-01")
    (tmp_path / "theirs" / "sub-01" / "surf" / "lh.white").touch()
    assert compared(tmp_path) == 2
    assert "sub-01 left has two surfaces" in capsys.readouterr().err


def test_pairs_keep_the_order_of_the_first_folder(tmp_path):
    one, two = Place("sub-01", "", "left"), Place("sub-02", "", "left")
    pairs, lost = paired_surfaces({one: tmp_path, two: tmp_path}, {two: tmp_path, one: tmp_path})
    assert (list(pairs), lost) == ([one, two], [])


def test_numbers_on_the_page_have_no_exponents():
    numbers = (2.7e-15, -2e-9, -0.00016, 0.0123456, -12.345, 20930.4)
    assert [_cell(value) for value in numbers] == ["0", "0", "−0.0002", "0.0123", "−12.3", "20\u202f930"]


def test_the_folder_of_one_scan_goes_with_another_or_with_the_only_subject(tmp_path):
    """As ``meshot reconstruct SCAN -o OUT`` writes it, and as the folder of one subject of FreeSurfer."""
    for folder in ("one", "two/surf", "study/sub-01"):
        (tmp_path / folder).mkdir(parents=True)
        for side in SHORT:
            write_mesh(tmp_path / folder / f"{SHORT[side]}.white", sphere(40.0, side))
    one, two, study = (find_surfaces(tmp_path / name) for name in ("one", "two", "study"))
    assert list(one) == list(two) == [Place("", "", "left"), Place("", "", "right")]
    assert str(one and next(iter(one))) == "left"
    assert list(paired_surfaces(one, two)[0]) == [Place("one", "", "left"), Place("one", "", "right")]
    for pair in ((one, study), (study, one)):
        assert list(paired_surfaces(*pair)[0]) == [Place("sub-01", "", "left"), Place("sub-01", "", "right")]
    assert main(["table", str(tmp_path / "one"), str(tmp_path / "study"), "-o", str(tmp_path / "out"), *FEW]) == 0
    assert [row["participant_id"] for row in read(tmp_path / "out" / "surfaces.tsv")] == ["sub-01", "sub-01"]
