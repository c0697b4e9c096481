"""The measures of a person's scan, on phantoms whose answers are known."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from meshot.mesh.geometry import face_areas
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.provenance import read_results
from meshot.volume.io import write_volume
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, transform_points, voxel_to_mm
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "person"
SHAPE, SIZE = (56, 56, 56), 1.0
WHITE_MM, GREY_MM = 20.0, 25.0
CORTEX, HINDBRAIN, DEEP, WALL = range(4)
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def grid_around_zero(shape=SHAPE, size=SIZE):
    affine = np.diag([size, size, size, 1.0])
    affine[:3, 3] = -size * (np.array(shape) - 1) / 2
    return Volume(np.zeros(shape), affine)


@pytest.fixture(scope="module")
def parts():
    """Grey and white matter of a ball of white matter in a shell of grey, and a small white ball far from both."""
    grid = grid_around_zero()
    white, whole, far = (
        enclosed_fractions(icosphere(4, radius, centre), grid)
        for radius, centre in ((WHITE_MM, (0, 0, 0)), (GREY_MM, (0, 0, 0)), (2.0, (24.0, 24.0, 24.0)))
    )
    return grid.with_data(whole - white), grid.with_data(np.clip(white + far, 0, 1))


@pytest.fixture
def estimate(part, parts):
    return part("estimate").Estimate(*parts)


@pytest.fixture
def all_cortex(parts):
    return parts[0].with_data(np.zeros(SHAPE, dtype=np.int8))


def heights(grid):
    """x, y, z of every voxel."""
    return [grid.affine[k, :3] @ np.indices(grid.data.shape).reshape(3, -1) + grid.affine[k, 3] for k in range(3)]


def test_squares_cover_the_sides_of_a_box(part):
    white = np.zeros((9, 10, 11))
    white[2:5, 3:7, 4:9] = 1
    inside, affine = np.array([3, 4, 5]), np.eye(4)
    affine[:3, :3] = TURN @ np.diag([1.2, 0.9, 1.5])
    lengths = inside * [1.2, 0.9, 1.5]
    estimate = part("estimate").Estimate(Volume(1 - white, affine), Volume(white, affine))
    squares = part("estimate").border_squares(estimate)
    areas = [lengths[a] * lengths[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    assert float(face_areas(squares).sum()) == pytest.approx(2 * sum(areas))
    assert len(squares.faces) == 2 * 2 * (3 * 4 + 4 * 5 + 5 * 3)
    centres = part("estimate").square_centres(squares)
    middle = voxel_to_mm(estimate.white, torch.tensor([[3.0, 4.5, 6.0]], dtype=torch.float64)).numpy()
    np.testing.assert_allclose(centres.mean(axis=0), middle[0], atol=1e-9)
    local = np.abs(np.linalg.solve(affine[:3, :3], (centres - middle).T).T)
    np.testing.assert_allclose((local / (inside / 2)).max(axis=1), 1)  # every square is on a side


def test_distances_to_a_larger_ball_are_those_of_the_formula(part, estimate, all_cortex):
    squares = part("estimate").border_squares(estimate)
    radii = np.linalg.norm(part("estimate").square_centres(squares), axis=1)
    found = part("measures").border_distances(icosphere(6, 22.0), estimate, all_cortex, 20_000, 0)
    there = found["surface"]["there"]
    assert there["n"] == found["n_squares"] == len(radii)
    for name, value in (("mean", (22 - radii).mean()), ("median", np.median(22 - radii))):
        assert there[name] == pytest.approx(value, abs=0.01)
    # The corners of the steps stand out of the ball of white matter, so the way back is shorter than 2 mm.
    corners = squares.vertices.reshape(-1, 4, 3).numpy()
    across = np.stack(np.meshgrid(*(np.arange(7) / 6,) * 2), axis=-1).reshape(-1, 2)
    weights = np.stack([(1 - a) * (1 - b) for a, b in ((across[:, 0], across[:, 1]), (1 - across[:, 0], across[:, 1]),
                        (1 - across[:, 0], 1 - across[:, 1]), (across[:, 0], 1 - across[:, 1]))])  # fmt: skip
    dense = np.einsum("wk,nwc->nkc", weights, corners).reshape(-1, 3)
    back = cKDTree(dense).query(icosphere(5, 22.0).vertices.numpy())[0]
    assert found["surface"]["back"]["mean"] == pytest.approx(back.mean(), abs=0.02)
    assert 1.5 < found["surface"]["back"]["median"] < 2
    assert found["floor"]["there"]["mean"] == pytest.approx(np.abs(radii - WHITE_MM).mean(), abs=0.03)
    assert 0.1 < found["floor"]["there"]["median"] < 0.3
    assert found["share_left_out"] == 0


def test_what_lies_outside_the_brain_or_the_cortex_does_not_count(part, parts, estimate, all_cortex):
    x, _, _ = heights(parts[0])
    left_out = all_cortex.with_data(np.where(x.reshape(SHAPE) < 0, DEEP, CORTEX).astype(np.int8))
    # A surface that is wrong by 2 mm in one half and in the other half right.
    ball = icosphere(6, WHITE_MM)
    wrong = ball.with_vertices(torch.where(ball.vertices[:, :1] < 0, ball.vertices * 1.1, ball.vertices))
    found = part("measures").border_distances(wrong, estimate, left_out, 20_000, 0)
    assert found["share_left_out"] == pytest.approx(0.5, abs=0.01)
    assert found["surface"]["there"]["mean"] == pytest.approx(found["floor"]["there"]["mean"], abs=0.04)
    assert found["surface"]["back"]["mean"] < 0.3
    with pytest.raises(ValueError, match="no point lies beside the cortex"):
        part("measures").border_distances(ball, estimate, all_cortex.with_data(left_out.data * 0 + DEEP), 100, 0)


@pytest.fixture
def atlas(part):
    """The hindbrain below z = −5, deep structures in a ball at (12, 0, 0), the medial wall at y < 0."""
    grid = grid_around_zero()
    x, y, z = (axis.reshape(SHAPE) for axis in heights(grid))
    to_deep = np.sqrt((x - 12) ** 2 + y**2 + z**2)
    ends = [np.array([[0.0, sign * 15, 10]]) for sign in (-1, 1)]
    return part("regions").Atlas(grid.with_data(-5.0 - z), grid.with_data(to_deep), *ends)


def test_the_hindbrain_ends_at_the_gap_of_the_person_and_not_of_the_template(part, parts, atlas):
    _, _, z = (axis.reshape(SHAPE) for axis in heights(parts[0]))
    tissue = np.where(np.abs(z + 8) < 0.7, 0.0, 1.0)  # voxels at −7.5 and −8.5
    moved = np.eye(4)
    moved[0, 3] = 3.0  # the person lies 3 mm to the left of the template
    labels = part("regions").region_labels(parts[0], tissue, atlas, moved, core_mm=4.0, deep_mm=3.0)
    assert (labels.data[z > -7] != HINDBRAIN).all()
    assert (labels.data[z < -9] == HINDBRAIN).all()
    at = np.array([[9.0, 0, 0], [11.5, 0, 0], [13.5, 0, 0], [0, -20, 10], [0, 20, 10], [0, 0, -20], [0, 0, 99]])
    expected = [DEEP, DEEP, CORTEX, WALL, CORTEX, HINDBRAIN, CORTEX]
    assert part("regions").labels_at(labels, at).tolist()[:2] == expected[:2]
    assert part("regions").labels_at(labels, at).tolist()[3:] == expected[3:]
    # The cap of a ball below a height h has the area 2πr (r − h), as Archimedes found.
    areas = part("measures").areas_by_region(icosphere(6, 15.0), labels)
    assert areas["hindbrain"] == pytest.approx(2 * np.pi * 15 * (15 - 8) / 100, rel=0.06)
    assert sum(areas.values()) == pytest.approx(4 * np.pi * 15**2 / 100, rel=1e-3)


def test_areas_are_those_of_the_balls(part, estimate, all_cortex):
    found = part("measures").compared_areas(icosphere(5, 22.0), estimate, all_cortex)
    assert found["estimate_cm2"]["cortex"] == pytest.approx(4 * np.pi * WHITE_MM**2 / 100, rel=0.01)
    assert found["excess_at_cortex"] == pytest.approx((22 / WHITE_MM) ** 2 - 1, abs=0.015)
    assert found["share_in_hindbrain"] == 0


def test_what_the_topology_step_took_is_counted_and_located(part, all_cortex):
    mask = np.zeros((20, 20, 20), dtype=bool)
    mask[4:16, 4:16, 4:16] = True
    ball = mask.copy()
    ball[5:7, 5:7, 5:7] = False  # 8 voxels
    ball[14, 14, 12:15] = False  # 3 voxels
    affine = np.diag([2.0, 1.0, 1.0, 1.0])  # voxels of 2 mm³ of the mask
    to_scanner = np.eye(4)
    to_scanner[:3, 3] = [-20.4, -10, -10]
    to_scanner[1, 1] = 0.5  # 1 mm³ of the scanner
    labels = all_cortex.with_data(np.where(np.arange(56)[:, None, None] < 20, HINDBRAIN, CORTEX) * np.ones(SHAPE, int))
    volumes = (Volume(mask, affine), Volume(ball, affine))
    found = part("measures").given_up(*volumes, labels, to_scanner, n_clusters=1)
    assert found["cm3"] == pytest.approx(11 / 1000)
    assert found["share"] == pytest.approx(11 / 12**3)
    # Voxels i of the mask lie at 2i − 20.4 mm; the labels of the hindbrain end at −8 mm, between 6 and 7.
    assert found["cm3_by_region"] == pytest.approx({"cortex": 0.003, "hindbrain": 0.008, "deep": 0, "medial wall": 0})
    assert found["share_at_cortex"] == pytest.approx(3 / (12 * 12 * 9))
    assert found["largest_clusters"] == [{"mm3": 8.0, "centre_mm_of_mask": [11.0, 5.5, 5.5], "region": "hindbrain"}]
    none = part("measures").given_up(volumes[0], volumes[0], labels, to_scanner, n_clusters=3)
    assert (none["cm3"], none["largest_clusters"]) == (0, [])


def test_estimates_that_will_not_do_are_refused(part, parts):
    grey, white = parts
    shifted = Volume(white.data, white.affine + np.eye(4, k=3))
    for change, why in (
        (lambda: (grey, shifted), "share one grid"),
        (lambda: (grey, white.with_data(100 * white.data)), r"parts of a voxel in \[0, 1\]"),
    ):
        refuses(why, part("estimate").Estimate, *change())
    with pytest.raises(ValueError, match="no voxel of grey matter"):
        part("estimate").border_squares(part("estimate").Estimate(grey.with_data(0 * grey.data), white))
    estimate = part("estimate").Estimate(grey, white)
    refuses("share one grid", part("run").require_one_grid, shifted, estimate)


@pytest.fixture(scope="module")
def scan(parts):
    """White matter 200, grey 120, fluid 40 around it, noise of 3; brighter on one side, so that no turn is hidden."""
    grey, white = parts
    x, _, _ = heights(grey)
    fluid = np.clip(enclosed_fractions(icosphere(4, 26.5), grey) - grey.data - white.data, 0, 1)
    clean = 200 * white.data + 120 * grey.data + 40 * fluid
    noise = np.random.default_rng(7).normal(0, 3, SHAPE)
    inside = clean > 1
    return grey.with_data(np.where(inside, np.maximum(clean + 0.5 * x.reshape(SHAPE) + noise, 1), 0))


@pytest.mark.parametrize("name", ["stored otherwise", "turned", "voxels of 1.3 mm", "mirrored",
                                  "voxels of 0.8 × 0.8 × 1.2 mm"])  # fmt: skip
def test_every_voxel_of_a_moved_scan_shows_its_place_in_the_person(part, config, scan, parts, name):
    changed = part("variants").changed_scan(scan, parts[1], config["variants"][name])
    places = np.argwhere(changed.scan.data > 150)[::97].astype(np.float64)
    there = voxel_to_mm(changed.scan, torch.from_numpy(places))
    back = transform_points(changed.to_person, there)
    index = np.rint(transform_points(np.linalg.inv(scan.affine), back).numpy()).astype(int)
    values = changed.scan.data[tuple(places.astype(int).T)] - scan.data[tuple(index.T)]
    assert len(places) > 100
    exact = name in ("stored otherwise", "mirrored")
    assert np.abs(values).max() == 0 if exact else np.abs(values).mean() < 4
    assert np.linalg.norm(there - back, axis=1).max() > 1 if name in ("turned", "mirrored") else (there == back).all()
    assert changed.mirrors() == (name == "mirrored")
    volume = (changed.scan.data > 80).sum() * abs(np.linalg.det(changed.scan.affine))
    assert volume == pytest.approx((scan.data > 80).sum(), rel=0.03)


def test_a_skull_lies_around_the_brain_and_leaves_it_as_it_is(part, scan, parts):
    how = {"kind": "with_skull", "layers_mm": [2.0, 6.0, 5.0], "of_white": [0.2, 0.12, 0.95]}
    changed = part("variants").changed_scan(scan, parts[1], how)
    margin = (np.array(changed.scan.data.shape) - np.array(SHAPE)) // 2
    assert (margin * SIZE >= 13).all()
    inner = changed.scan.data[tuple(slice(m, -m) for m in margin)]
    brain = (scan.data > 0) & (
        np.linalg.norm(heights(scan), axis=0).reshape(SHAPE) < 28
    )  # not the small ball beside it
    assert (inner[brain] == scan.data[brain].astype(np.float32)).all()
    away = np.linalg.norm(heights(changed.scan), axis=0).reshape(changed.scan.data.shape) - 26.5  # radius of the fluid
    level = np.median(scan.data[parts[1].data > 0.99])
    for low, high, part_of_white in ((0.5, 1.5, 0.2), (3, 7, 0.12), (9, 12, 0.95), (15, 16, 0.0)):
        layer = changed.scan.data[(away > low) & (away < high)]
        assert np.median(layer) / level == pytest.approx(part_of_white, abs=0.04)


def test_noise_bias_and_contrast_are_of_the_stated_size(part, config, scan, parts):
    variants, white = part("variants"), parts[1]

    def changed(name):
        return variants.changed_scan(scan, white, config["variants"][name]).scan

    before = variants.noise_level(scan, white)
    assert before == pytest.approx(3, rel=0.1)
    assert variants.noise_level(changed("noise doubled"), white) == pytest.approx(2 * before, rel=0.1)
    brain = scan.data > 0
    field = np.log(changed("bias").data[brain] / scan.data[brain])
    assert field.std() == pytest.approx(config["variants"]["bias"]["of_logarithm"], rel=1e-3)
    inverted, bright = changed("inverted").data, changed("bright fluid").data
    assert np.corrcoef(inverted[brain], scan.data[brain])[0, 1] < -0.95
    dark = brain & (scan.data < 85)
    assert bright[dark].min() > 200
    light = scan.data > 95
    np.testing.assert_allclose(bright[light], scan.data[light].astype(np.float32))
    for name in ("noise doubled", "bias", "inverted", "bright fluid"):
        assert (changed(name).data[~brain] == 0).all()
    cropped, z = changed("cropped at the neck").data, heights(scan)[2].reshape(SHAPE)
    limit = -20 + config["variants"]["cropped at the neck"]["lowest_mm"]
    assert (cropped[z < limit - 1] == 0).all()
    assert (cropped[z > limit + 1] == scan.data[z > limit + 1]).all()
    refuses("known are stored, turned", variants.changed_scan, scan, white, {"kind": "melted"})


def balls(to_scanner=None):
    """The surfaces of two sides, which differ."""
    made = {"left": icosphere(4, 12.0, (-9.0, 2.0, 0.0)), "right": icosphere(4, 10.0, (9.0, 0.0, 4.0))}
    matrix = np.eye(4) if to_scanner is None else to_scanner
    return {side: mesh.with_vertices(transform_points(matrix, mesh.vertices)) for side, mesh in made.items()}


def made_of(meshes, mask, to_standard):
    segmented = SimpleNamespace(mask=mask, genus_zero_mask=mask)
    return SimpleNamespace(
        scan=SimpleNamespace(to_standard=to_standard), wall_seconds={}, cpu_seconds={},
        warnings=(SimpleNamespace(name="odd", text="it is odd"),),
        surfaces={side: SimpleNamespace(final=mesh, segmented=segmented) for side, mesh in meshes.items()},
    )  # fmt: skip


@pytest.fixture
def asked(tmp_path, scan, parts):
    files = dict(zip(("grey", "white", "scan"), (*parts, scan), strict=True))
    for name, volume in files.items():
        write_volume(tmp_path / f"{name}.nii.gz", volume.with_data(volume.data.astype(np.float32)))
    return {name: str(tmp_path / f"{name}.nii.gz") for name in files}


def test_a_change_is_measured_where_the_person_is(part, config, asked, tmp_path, monkeypatch):
    run, networks = part("run"), SimpleNamespace(segmentation=None, system=None)
    for side, mesh in balls().items():
        run.write_surface(tmp_path / f"{side}.safetensors", mesh)
    for name in ("turned", "mirrored"):
        way = run.changed_scan(*map(run.read_volume, (asked["scan"], asked["white"])), config["variants"][name])
        seen = balls(np.linalg.inv(way.to_person))
        if name == "mirrored":
            seen = {"left": seen["right"], "right": seen["left"]}
        monkeypatch.setattr(run, "reconstruct", lambda *a, seen=seen: made_of(seen, None, np.eye(4)))
        found = run.compared(name, networks, config | asked | {"n_points": 1000}, tmp_path)
        assert max(each["assd"] for each in found["change_mm"].values()) < 1e-6
        assert found["warning_names"] == ["odd"]
    larger = {side: mesh.with_vertices(mesh.vertices * 1.1) for side, mesh in balls().items()}
    monkeypatch.setattr(run, "reconstruct", lambda *a: made_of(larger, None, np.eye(4)))
    found = run.compared("bias", networks, config | asked | {"n_points": 1000}, tmp_path)
    assert found["change_mm"]["left"]["assd"] > 0.5

    def refuses(*arguments):
        raise ValueError("no brain")

    monkeypatch.setattr(run, "reconstruct", refuses)
    assert run.compared("bias", networks, config | asked, tmp_path) == {"refused": "no brain"}


def test_all_numbers_of_a_scan(part, config, asked, all_cortex, tmp_path, monkeypatch):
    run = part("run")
    to_standard = np.eye(4)
    to_standard[:3, 3] = [5, 0, 0]
    mask = Volume(np.ones((3, 3, 3), dtype=bool), np.eye(4))
    monkeypatch.setattr(run, "reconstruct", lambda *a: made_of(balls(), mask, to_standard))
    monkeypatch.setattr(run, "registered_labels", lambda *a: (all_cortex, to_standard))
    networks = SimpleNamespace(segmentation=None, system=None)
    found = run.measured(networks, config | asked | {"n_points": 1000}, tmp_path)
    assert found["volumes_cm3"]["left"] == pytest.approx(4 / 3 * np.pi * 12**3 / 1000, rel=0.02)
    assert found["areas"]["surface_cm2"]["cortex"] == pytest.approx(4 * np.pi * (12**2 + 10**2) / 100, rel=0.02)
    assert found["given_up"]["right"]["share"] == 0
    assert isinstance(run.read_surface(tmp_path / "left.safetensors"), Mesh)


@pytest.mark.parametrize("name", ["results", "robustness"])
def test_committed_results_hold_numbers_alone_and_belong_to_their_configuration(name):
    path = FOLDER / f"{name}.json"
    record = read_results(path)
    config = record["config"]
    assert record["results"]["inputs"]["files"] == config["source"]["sha256"]
    assert path.stat().st_size < 40_000
    assert not [path.name for path in FOLDER.iterdir() if path.suffix not in (".py", ".yaml", ".json", "")]
