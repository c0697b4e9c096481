"""Cohorts on disk: whole or absent, gone on with, read back as they were made; hashes by content."""

import dataclasses
import functools
import gzip
import json
import os
import platform
import shutil
import subprocess
import sys

import nibabel
import numpy as np
import pytest
import torch

from meshot.cli import main
from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.io import write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.provenance import processor
from meshot.synth import generation, scanning
from meshot.synth.cohorts import LABELS, participants, read_subject, scans
from meshot.synth.generation import changed_files, content_hash, keep_digests, make_cohort, open_cohort, visits
from meshot.synth.recipe import Recipe, plan, read_recipe, recipe_text
from meshot.synth.subject import CorticalSurfaces
from meshot.volume.io import read_volume, write_volume
from meshot.volume.registration import SHAPE, place_on_grid
from meshot.volume.volume import Volume, transform_points, voxel_sizes
from refusals import refuses

SIGNAL = {"white": 440, "grey": 310, "deep grey": 360, "hindbrain": 365, "fluid": 110, "skull": 60, "scalp": 480}
POSITION = {"voxel_mm": [5.0, 5.0, 6.0], "oblique_degrees": 10.0, "orientation": "LAS"}
RECIPE = Recipe("balls", 3, 2, 1, appearance={"signal": SIGNAL, "noise": [5, 15]}, position=POSITION, n_lines=2)


def balls(shape, seed):
    size = 1 + 0.1 * np.random.default_rng(seed).random()
    white, pial = (
        {side: icosphere(3, r * size, (x, -18.0, 14.0)) for side, x in (("left", -40.0), ("right", 40.0))}
        for r in (31.0, 34.0)
    )
    wall = {side: torch.zeros(len(white[side].vertices), dtype=torch.bool) for side in white}
    return CorticalSurfaces(white, pial, wall)


def on_grid(scan, template, seed=0):
    return place_on_grid(scan, np.linalg.inv(np.round(MOTION[-1], 6)), np.array([0.0, -18.0, 14.0]))


MOTION = [np.eye(4)]


@pytest.fixture
def quick(monkeypatch):
    def simulated(*arguments):
        scan = scanning.simulated_scan(*arguments)
        MOTION[-1] = scan.head_to_scanner
        return scan

    generation._surfaces.cache_clear()
    monkeypatch.setattr(generation, "synthetic_subject", balls)
    monkeypatch.setattr(generation, "simulated_scan", simulated)
    monkeypatch.setattr(scanning, "standard_scan", on_grid)
    monkeypatch.setattr(scanning, "_template", lambda size: None)
    yield
    generation._surfaces.cache_clear()


def test_a_cohort_is_read_as_it_was_made(quick, tmp_path):
    assert list(make_cohort(RECIPE, tmp_path / "c")) == ["sub-001", "sub-002", "sub-p01"]
    assert participants(tmp_path / "c") == plan(RECIPE)
    assert [p.participant_id for p in participants(tmp_path / "c", "test")] == ["sub-002", "sub-p01"]
    subject = read_subject(tmp_path / "c", "sub-002")
    scan, tissue, standard = subject.scan(), subject.tissue(), subject.standard()
    assert subject.name == "sub-002"
    assert scan.data.shape == tissue.data.shape
    np.testing.assert_allclose(voxel_sizes(scan), [5, 5, 6], rtol=1e-6)
    assert set(np.unique(tissue.data)) <= {0, *LABELS.values()}
    assert standard.volume.data.shape == subject.standard_labels().data.shape == SHAPE
    # The surfaces, carried to the standard space, lie where the labels are.
    for label, side in enumerate(("left", "right"), start=1):
        there = subject.surface("white", side, "standard").vertices
        torch.testing.assert_close(standard.to_scanner(there), subject.surface("white", side).vertices)
        labels = subject.standard_labels()
        places = np.argwhere(labels.data == label) @ labels.affine[:3, :3].T + labels.affine[:3, 3]
        np.testing.assert_allclose(places.mean(axis=0), there.mean(dim=0).numpy(), atol=0.1)
    facts = subject.facts()
    assert facts["participant"]["split"] == subject.participant.split
    assert 5 <= facts["knobs"]["appearance"]["noise"] <= 15
    np.testing.assert_allclose(np.linalg.inv(facts["head_to_scanner"]), subject.to_standard(), atol=2e-3)
    assert changed_files(tmp_path / "c") == []


def test_what_was_stopped_goes_on_and_ends_the_same(quick, tmp_path, monkeypatch):
    list(make_cohort(RECIPE, tmp_path / "whole"))
    made, write = [], scanning.write_scan

    def dying(place, *rest):
        write(place, *rest)
        made.append(place.name)
        if len(made) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(generation, "write_scan", dying)
    with pytest.raises(KeyboardInterrupt):
        list(make_cohort(RECIPE, tmp_path / "c"))
    assert [p.participant_id for p in participants(tmp_path / "c")] == ["sub-001"]
    assert len(participants(tmp_path / "c", unfinished=True)) == 3
    assert not list((tmp_path / "c").glob(".writing-*"))
    refuses("no finished scan sub-002", read_subject, tmp_path / "c", "sub-002")
    refuses("not finished", changed_files, tmp_path / "c")
    # As a kill leaves it that even the clearing up does not survive: derivatives without their scan.
    (tmp_path / "c" / "derivatives" / "standard" / "sub-002" / "anat").mkdir(parents=True)
    assert list(make_cohort(RECIPE, tmp_path / "c")) == ["sub-002", "sub-p01"]
    first, second = ((tmp_path / name / "manifest.json").read_text(encoding="utf-8") for name in ("whole", "c"))
    assert first == second
    assert json.loads(first)["processors"] == [processor()]
    assert list(make_cohort(RECIPE, tmp_path / "c")) == []


def test_half_a_visit_is_none(quick, tmp_path, monkeypatch):
    one = dataclasses.replace(RECIPE, subjects=1, procedural_subjects=0)
    move = os.replace

    def dying(source, target):
        move(source, target)
        if os.path.isdir(target):
            raise KeyboardInterrupt  # one of its two folders is in place, the other is not

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", dying)
        with pytest.raises(KeyboardInterrupt):
            list(make_cohort(one, tmp_path / "c"))
    assert (tmp_path / "c" / "derivatives" / "standard" / "sub-001").is_dir()
    assert participants(tmp_path / "c") == []
    assert list(make_cohort(one, tmp_path / "c")) == ["sub-001"]
    assert changed_files(tmp_path / "c") == []


def test_digests_of_several_cohorts_are_kept_in_one_file(quick, tmp_path):
    one = dataclasses.replace(RECIPE, subjects=1, procedural_subjects=0)
    open_cohort(one, tmp_path / "c")
    refuses("not finished", keep_digests, tmp_path / "kept.json", tmp_path / "c")
    list(make_cohort(one, tmp_path / "c"))
    list(make_cohort(dataclasses.replace(one, name="aside", seed=9), tmp_path / "d"))
    for folder in ("c", "d", "c"):
        keep_digests(tmp_path / "kept.json", tmp_path / folder)
    kept = json.loads((tmp_path / "kept.json").read_text(encoding="utf-8"))
    assert list(kept) == ["aside", "balls"]
    whole = json.loads((tmp_path / "c" / "manifest.json").read_text(encoding="utf-8"))["scans"]["sub-001"]
    assert kept["balls"]["scans"] == {"sub-001": {key: whole[key] for key in ("split", "seed", "digest")}}
    assert kept["aside"]["scans"]["sub-001"]["digest"] != whole["digest"]


def test_more_subjects_are_added_to_a_cohort(quick, tmp_path):
    few = dataclasses.replace(RECIPE, subjects=1, procedural_subjects=0)
    assert list(make_cohort(few, tmp_path / "c")) == ["sub-001"]
    assert list(make_cohort(RECIPE, tmp_path / "c")) == ["sub-002", "sub-p01"]


def test_held_out_subjects_are_added_to_a_cohort(quick, tmp_path):
    few = dataclasses.replace(RECIPE, subjects=1, procedural_subjects=1)
    assert list(make_cohort(few, tmp_path / "c")) == ["sub-001", "sub-p01"]
    before = {p: p.read_bytes() for p in (tmp_path / "c" / "sub-001").rglob("*.*")}
    assert list(make_cohort(dataclasses.replace(few, held_out_subjects=1), tmp_path / "c")) == ["sub-h01"]
    assert [s.name for s in scans(tmp_path / "c", "test")] == ["sub-h01", "sub-p01"]
    assert {p: p.read_bytes() for p in (tmp_path / "c" / "sub-001").rglob("*.*")} == before


def test_sessions_and_runs(quick, tmp_path):
    retest = dataclasses.replace(
        RECIPE, subjects=1, procedural_subjects=0, days=2, scans_per_day=2, split={"test": 1.0}
    )
    assert list(make_cohort(retest, tmp_path / "c")) == ["sub-001/ses-01", "sub-001/ses-02"]
    found = scans(tmp_path / "c")
    assert [s.name for s in found] == [f"sub-001_ses-0{d}_run-{r}" for d in (1, 2) for r in (1, 2)]
    assert read_subject(tmp_path / "c", "sub-001", "02").name == "sub-001_ses-02_run-1"
    assert read_subject(tmp_path / "c", "sub-001", "02", "2").name == found[3].name
    # The same surfaces in another position, under new noise.
    motions = [np.array(s.facts()["head_to_scanner"]) for s in found]
    heads = []
    for scan, motion in zip(found, motions):
        vertices = scan.surface("pial", "right").vertices.numpy()
        heads.append((vertices - motion[:3, 3]) @ np.linalg.inv(motion[:3, :3]).T)
    for head, motion in zip(heads[1:], motions[1:]):
        np.testing.assert_allclose(head, heads[0], atol=0.002)
        assert not np.allclose(motion, motions[0])
    assert len({content_hash(s.file("T1w.nii.gz")) for s in found}) == 4
    refuses("ses-07", read_subject, tmp_path / "c", "sub-001", "07")
    assert len(visits(dataclasses.replace(retest, days=20))) == 20


def test_every_change_shows(quick, tmp_path):
    one = dataclasses.replace(RECIPE, subjects=1, procedural_subjects=0)
    list(make_cohort(one, tmp_path / "c"))
    subject = read_subject(tmp_path / "c", "sub-001")
    path = subject.file("T1w.nii.gz")
    scan = subject.scan()
    changed = scan.data.astype(np.int16)
    write_volume(path, scan.with_data(changed))
    assert changed_files(tmp_path / "c") == []  # packed anew, but the same
    changed[3, 4, 5] += 1
    write_volume(path, scan.with_data(changed))
    assert changed_files(tmp_path / "c") == [path.name]
    path.write_bytes(path.read_bytes()[:500])
    assert changed_files(tmp_path / "c") == [path.name]
    shutil.rmtree(tmp_path / "c" / "sub-001")
    assert len(changed_files(tmp_path / "c")) == 10


@functools.cache
def _text(rows):
    return "participant_id\tsplit\tkind\tseed\n" + "\n".join(rows)


def test_doors(quick, tmp_path, unchecked):
    refuses("is no cohort", participants, tmp_path)
    (tmp_path / "participants.tsv").write_text(_text(("sub-001\ttrain\ttemplate\tx",)))
    refuses("no table of participants", participants, tmp_path)
    refuses("split is 'training'", participants, tmp_path, "training")
    refuses("holds no cohort", open_cohort, RECIPE, tmp_path)
    open_cohort(RECIPE, tmp_path / "c")
    for other in ({"seed": 4}, {"appearance": {"signal": SIGNAL}}, {"days": 2}):
        refuses("another recipe", open_cohort, dataclasses.replace(RECIPE, **other), tmp_path / "c")
    refuses("jobs", list, make_cohort(RECIPE, tmp_path / "c", jobs=0))
    list(make_cohort(dataclasses.replace(RECIPE, subjects=1, procedural_subjects=0), tmp_path / "d"))
    subject = read_subject(tmp_path / "d", "sub-001")
    refuses("no surface 'grey'", subject.surface, "grey", "left")
    subject.file("T1w.json").write_text("{")
    refuses("not whole JSON", subject.facts)
    subject.file("T1w.json").unlink()
    refuses("does not exist", subject.facts)


OLD_CPU = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "ATEN_CPU_CAPABILITY": "default",
    "OPENBLAS_CORETYPE": "Nehalem",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-AVX2_Usable,-FMA_Usable",
}


@pytest.fixture(scope="module")
def made_by_command(tmp_path_factory):
    """A cohort of the committed subject alone, from the command line, by a second process, as on an older CPU."""
    folder, old = tmp_path_factory.mktemp("command"), os.environ.copy()
    if platform.machine() == "x86_64":
        known = set(np._core._multiarray_umath.__cpu_dispatch__)
        features = [name for name in OLD_CPU["NPY_DISABLE_CPU_FEATURES"].split() if name in known]
        old |= OLD_CPU | {"NPY_DISABLE_CPU_FEATURES": " ".join(features)}
    only = dataclasses.replace(read_recipe("tiny"), subjects=1, procedural_subjects=0)
    (folder / "one.yaml").write_text(recipe_text(only), encoding="utf-8")
    words = [sys.executable, "-m", "meshot", "make-cohort", "one.yaml", "c", "--jobs", "2"]
    done = subprocess.run(words, cwd=folder, env=old, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    assert "100%" in done.stderr
    return folder / "c"


def test_the_command_makes_a_cohort_and_checks_it(made_by_command, capsys):
    assert [s.name for s in scans(made_by_command)] == ["sub-001"]
    assert json.loads((made_by_command / "manifest.json").read_text(encoding="utf-8"))["recipe"] == "tiny"
    assert read_volume(made_by_command / "sub-001" / "anat" / "sub-001_T1w.nii.gz").data.max() > 300
    recipe, cohort = str(made_by_command.parent / "one.yaml"), str(made_by_command)
    assert main(["make-cohort", recipe, cohort, "--check"]) == 0
    assert capsys.readouterr().out.strip() == "every file is as it was made"
    for words, said in (
        (["oasis_like", cohort], "another recipe"),
        ([recipe, cohort, "--standard", "white matter"], "another recipe (different: standard)"),
        ([recipe, "d", "--standard", "air"], "standard is 'air'; one of grey values, white matter"),
    ):
        assert main(["make-cohort", *words]) == 2
        assert said in capsys.readouterr().err


def test_the_committed_subject_is_made_again_as_on_an_older_cpu(root, made_by_command):
    hashes = json.loads((made_by_command / "logs" / "sub-001.json").read_text(encoding="utf-8"))["hashes"]["sub-001"]
    kept = read_subject(root / "data_synth" / "sample", "sub-001").files()
    assert len(kept) == 8
    assert {path.name: content_hash(path) for path in kept} == {path.name: hashes[path.name] for path in kept}


def test_the_committed_subject_is_small_and_sound(root):
    folder = root / "data_synth" / "sample"
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < 1.5e6
    subject = read_subject(folder, "sub-001")
    for side in ("left", "right"):
        meshes = [subject.surface(kind, side) for kind in ("white", "pial")]
        assert [topology(mesh) for mesh in meshes] == [SPHERE, SPHERE]
        assert [len(self_intersecting_faces(mesh)) for mesh in meshes] == [0, 0]
        there = subject.surface("white", side, "standard").vertices
        back = transform_points(np.linalg.inv(subject.to_standard()), there.float()).double()
        assert float((back - meshes[0].vertices).norm(dim=1).max()) < 0.01
    white = np.isin(subject.tissue().data, (1, 2))
    grey = np.isin(subject.tissue().data, (3, 4))
    assert subject.scan().data[white].mean() > 1.2 * subject.scan().data[grey].mean()
    refuses("does not exist", subject.standard)


IMAGE = np.random.default_rng(0).integers(0, 500, (4, 6, 5)).astype(np.int16)
AFFINE = np.diag([1.0, 1.0, 1.2, 1.0])
MANIFEST_SPHERE = icosphere(1, 10.0)


def of_volume(folder, image, affine=AFFINE):
    write_volume(folder / "a.nii.gz", Volume(image, affine))
    return content_hash(folder / "a.nii.gz")


def of_mesh(folder, mesh):
    write_mesh(folder / "a.surf.gii", mesh)
    return content_hash(folder / "a.surf.gii")


def test_another_packing_is_the_same_content(tmp_path):
    volume, mesh = tmp_path / "a.nii.gz", tmp_path / "a.surf.gii"
    found, before = (
        [of_volume(tmp_path, IMAGE), of_mesh(tmp_path, MANIFEST_SPHERE)],
        [p.read_bytes() for p in (volume, mesh)],
    )
    volume.write_bytes(gzip.compress(gzip.decompress(before[0]), 1))
    image = nibabel.load(mesh)
    for array in image.darrays:
        array.encoding = nibabel.gifti.gifti.gifti_encoding_codes.code["GIFTI_ENCODING_B64BIN"]
    nibabel.save(image, mesh)
    assert [p.read_bytes() == b for p, b in zip((volume, mesh), before, strict=True)] == [False, False]
    assert [content_hash(volume), content_hash(mesh)] == found


def test_every_number_of_a_volume_counts(tmp_path):
    other, moved = IMAGE.copy(), AFFINE.copy()
    other[1, 2, 3] += 1
    moved[0, 3] += 0.001
    variants = [(IMAGE, AFFINE), (other, AFFINE), (IMAGE, moved), (IMAGE.reshape(6, 4, 5), AFFINE)]
    assert len({of_volume(tmp_path, *variant) for variant in variants}) == len(variants)


def test_every_number_of_a_mesh_counts(tmp_path):
    moved = MANIFEST_SPHERE.vertices.clone()
    moved[3, 1] += 0.001
    turned = MANIFEST_SPHERE.faces.clone()
    turned[5] = turned[5].flip(0)
    variants = [MANIFEST_SPHERE, MANIFEST_SPHERE.with_vertices(moved), Mesh(MANIFEST_SPHERE.vertices, turned)]
    assert len({of_mesh(tmp_path, mesh) for mesh in variants}) == len(variants)


@pytest.mark.parametrize("name", ["a.nii.gz", "a.surf.gii"])
def test_what_cannot_be_read_has_no_hash(tmp_path, name):
    (tmp_path / name).write_bytes(b"half")
    refuses(name, content_hash, tmp_path / name)


def test_other_files_are_hashed_by_their_bytes(tmp_path):
    for name, text in (("a.json", "{}"), ("b.json", "{}"), ("c.json", "{ }")):
        (tmp_path / name).write_text(text)
    a, b, c = (content_hash(tmp_path / f"{x}.json") for x in "abc")
    assert a == b != c
