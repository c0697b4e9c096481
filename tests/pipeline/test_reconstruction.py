"""From a scan in any position to both surfaces in its own space, and what is said about doubtful ones."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from bright_head import balls, bright_head, bright_template, brightness_network, shifting_network
from meshot.flow.crossings import RepairedSurface, nest_surfaces
from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.metrics.thickness import cortical_thickness
from meshot.pipeline.initial_surface import SegmentedSurface
from meshot.pipeline.quality import agreement_with, contrast_with, scan_warnings, surface_warnings, volume_warnings
from meshot.pipeline.reconstruction import reconstruct
from meshot.synth.subject import crossing_faces
from meshot.systems import Part, Scan, SurfaceSystem, get_system
from meshot.volume.registration import StandardScan, place_on_grid
from meshot.volume.volume import Volume
from refusals import refuses

SHIFTS = {"left": (0.0, 1.5, 2.0), "right": (1.0, 0.0, -1.0)}
TO_TEMPLATE = np.eye(4)
TO_TEMPLATE[:3, :3] = Rotation.from_euler("xyz", [5, -8, 10], degrees=True).as_matrix() * 1.08
TO_TEMPLATE[:3, 3] = [12, -25, 30]


def turned_grid(signs: tuple[int, int, int]) -> tuple[np.ndarray, tuple[int, int, int]]:
    """Axes in another order, some flipped, oblique, unequal voxels, around where the head lies."""
    sizes, shape = np.array([2.6, 3.0, 2.2]), np.array([62, 64, 70])
    affine = np.eye(4)
    turn = Rotation.from_euler("xyz", [9, 7, -12], degrees=True).as_matrix()
    affine[:3, :3] = turn @ np.eye(3)[[1, 2, 0]] * sizes * np.array(signs)
    middle = np.linalg.inv(TO_TEMPLATE) @ [0, -12, 9, 1]
    affine[:3, 3] = middle[:3] - affine[:3, :3] @ (shape / 2)
    return affine, tuple(int(n) for n in shape)


@pytest.fixture(scope="module")
def networks():
    parts = {f"{side}_white": Part(shifting_network(shift)) for side, shift in SHIFTS.items()}
    return brightness_network(), get_system("ddot")(parts)


#: Studies reconstruct a mirrored scan in make test, too.
MIRRORED = pytest.param((-1, 1, 1), marks=pytest.mark.thorough)


@pytest.fixture(scope="module", params=[(1, 1, 1), MIRRORED], ids=["oblique", "mirrored"])
def made(request, networks):
    affine, shape = turned_grid(request.param)
    assert np.linalg.det(affine) * request.param[0] > 0
    heard = []
    scan = bright_head(affine, shape, TO_TEMPLATE)
    before = scan.data.copy()
    found = reconstruct(scan, *networks, progress=lambda *words: heard.append(words), template=bright_template())
    assert np.array_equal(scan.data, before)
    return found, heard


def test_both_surfaces_lie_where_the_scanner_saw_them(made):
    found, _ = made
    for side, truth in balls(TO_TEMPLATE).items():
        initial = found.surfaces[side].initial
        assert topology(initial) == SPHERE
        assert len(self_intersecting_faces(initial)) == 0
        assert vertex_distances(initial, truth).mean() < 0.6
        assert vertex_distances(truth, initial).mean() < 0.6
        assert float(signed_volume(initial)) == pytest.approx(float(signed_volume(truth)), rel=0.05)


def test_the_flow_moves_them_in_the_standard_space(made):
    found, _ = made
    for side, surface in found.surfaces.items():
        shift = torch.tensor(SHIFTS[side], dtype=torch.float64)
        way = torch.from_numpy(np.linalg.inv(found.scan.to_standard)[:3, :3]) @ shift
        assert torch.equal(surface.final.faces, surface.initial.faces)
        moved = surface.final.vertices - surface.initial.vertices
        torch.testing.assert_close(moved, way.expand_as(moved), atol=1e-4, rtol=0)
        torch.testing.assert_close(surface.unrepaired.vertices, surface.initial.vertices + way, atol=1e-4, rtol=0)
        assert float(signed_volume(surface.final)) > 0
        assert len(self_intersecting_faces(surface.final)) == 0


def test_stages_are_told_and_timed(made):
    found, heard = made
    stages = ["registration", "white matter"]
    stages += [*(f"initial surface, {side}" for side in ("left", "right")), "system ddot", "crossing faces"]
    assert heard == [(name, k, 6) for k, name in enumerate([*stages, ""])]
    assert list(found.cpu_seconds) == list(found.wall_seconds) == stages
    assert all(0 < seconds < 60 for seconds in found.cpu_seconds.values())
    assert found.system == "ddot"
    assert {w.name for w in found.warnings} <= {"surface_volume", "bright_volume"}


def test_without_a_flow_the_initial_surface_is_the_result(networks):
    heard = []
    found = reconstruct(
        bright_template(), networks[0], None, progress=lambda *words: heard.append(words), template=bright_template()
    )
    assert found.system is None
    assert heard[-1] == ("", 4, 4)
    for surface in found.surfaces.values():
        assert surface.final is surface.initial
        assert surface.repaired is None


def test_doors(networks):
    scan = bright_template(8.0)
    half = type(networks[1])({"left_white": networks[1].parts["left_white"]})
    with pytest.raises(ValueError, match="ddot has no trained right_white"):
        reconstruct(bright_template(), networks[0], half, template=bright_template())
    one_sided = type("OneSided", (type(networks[1]),), {"name": "one", "surfaces": (("left", "white"),)})
    with pytest.raises(ValueError, match=r"one finds \(\('left', 'white'\),\); both white surfaces are needed here"):
        reconstruct(scan, networks[0], one_sided({}))
    refuses("everywhere", reconstruct, scan.with_data(np.full(scan.data.shape, 3.0)), *networks, template=scan)
    blind = brightness_network()
    with torch.no_grad():
        blind.head.bias[2] = -1e6
    refuses("no white matter on the right", reconstruct, scan, blind, None, template=scan)


class FixedBalls(SurfaceSystem):
    """Where the balls are, without a look at the scan: other faces than the initial surfaces have."""

    name, networks = "balls", {}
    surfaces = (("left", "white"), ("right", "white"))

    train_parts = classmethod(lambda cls, *_: {})

    def find_surfaces(self, scan):
        assert scan.initial == {}
        return {(side, "white"): mesh for side, mesh in balls(np.eye(4)).items()}


def test_a_system_without_initial_surfaces_is_not_repaired(networks):
    found = reconstruct(bright_template(), networks[0], FixedBalls({}), template=bright_template())
    assert found.system == "balls"
    for surface in found.surfaces.values():
        assert surface.repaired is surface.unrepaired is None
        assert len(surface.final.faces) == 20 * 4**5 != len(surface.initial.faces)
        assert vertex_distances(surface.final, surface.initial).mean() < 0.6


class Grown(FixedBalls):
    """The initial surfaces as white ones, and around them pial ones, which are larger by a factor."""

    needs = FixedBalls.surfaces
    surfaces = tuple((side, kind) for side in ("left", "right") for kind in ("white", "pial"))
    factor = 1.05

    def find_surfaces(self, scan):
        found = dict(scan.initial)
        for (side, _), mesh in scan.initial.items():
            middle = mesh.vertices.mean(dim=0)
            found[side, "pial"] = mesh.with_vertices(middle + self.factor * (mesh.vertices - middle))
        return found


def test_pial_surfaces_lie_around_the_white_ones(networks):
    heard = []
    found = reconstruct(
        bright_template(), networks[0], Grown({}), lambda *words: heard.append(words), template=bright_template()
    )
    assert heard[-2:] == [("four surfaces", 6, 7), ("", 7, 7)]
    meshes = [mesh for each in found.surfaces.values() for mesh in (each.final, each.pial)]
    assert len(crossing_faces(meshes)) == 0
    for each in found.surfaces.values():
        assert torch.equal(each.pial.faces, each.final.faces)
        assert float(signed_volume(each.pial)) == pytest.approx(1.05**3 * float(signed_volume(each.final)), rel=0.01)
        assert 0.5 < cortical_thickness(each.final, each.pial).mean() < 5


def test_pial_surfaces_that_would_overlap_stop_at_each_other(networks):
    """They are so large that left and right overlap."""
    large = type("Large", (Grown,), {"factor": 2.0, "name": "large"})
    found = reconstruct(bright_template(), networks[0], large({}), template=bright_template())
    assert "crossing_faces" not in {warning.name for warning in found.warnings}
    assert len(crossing_faces([mesh for each in found.surfaces.values() for mesh in (each.final, each.pial)])) == 0


class Overlapping(Grown):
    """The left white surface, half of it within the right one."""

    name = "overlapping"

    def find_surfaces(self, scan):
        left, right = (scan.initial[side, "white"] for side in ("left", "right"))
        middle = (right.vertices.mean(dim=0) - left.vertices.mean(dim=0)) * 0.7
        moved = Scan(scan.image, scan.initial | {("left", "white"): left.with_vertices(left.vertices + middle)})
        return super().find_surfaces(moved)


def test_four_surfaces_that_cannot_be_parted_are_doubted(networks, monkeypatch):
    def few_rounds(inner, outer):
        return nest_surfaces(inner, outer, max_rounds=3)

    monkeypatch.setattr("meshot.pipeline.reconstruction.nest_surfaces", few_rounds)
    found = reconstruct(bright_template(), networks[0], Overlapping({}), template=bright_template())
    assert "crossing_faces" in {warning.name for warning in found.warnings}
    assert "two of the four surfaces cross" in " ".join(map(str, found.warnings))


class TurnedEdges(FixedBalls):
    """The initial surfaces, with the ends of every 400th edge exchanged: some faces cross there."""

    needs = FixedBalls.surfaces

    def find_surfaces(self, scan):
        found = {}
        for key, mesh in scan.initial.items():
            ends = mesh.faces[::400, :2]
            turned = mesh.vertices.clone()
            turned[ends] = turned[ends].flip(1) * 1.01
            found[key] = mesh.with_vertices(turned)
        return found


def test_two_hundredths_of_crossing_faces_are_smoothed(networks):
    """The defaults of the repair would move these surfaces back towards the initial ones."""
    found = reconstruct(bright_template(), networks[0], TurnedEdges({}), template=bright_template())
    for surface in found.surfaces.values():
        assert 0.012 < surface.repaired.n_crossing / len(surface.final.faces) < 0.028
        assert surface.repaired.n_backtracks == 0
        assert len(self_intersecting_faces(surface.final)) == 0


def place(matrix: np.ndarray) -> StandardScan:
    return place_on_grid(bright_template(), matrix, np.array([0.0, -12, 9]))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (np.diag([1.0, 1, 1, 1]), {}),
        (np.diag([0.7, 0.7, 0.7, 1]), {"scale": 0.7}),
        (np.diag([1.4, 1.4, 1.4, 1]), {"agreement": None, "scale": 1.4}),
        (np.diag([-1.0, 1, 1, 1]), {"mirrored": None}),
        (np.array([[1.0, 0, 0, 60], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), {"agreement": None}),
    ],
    ids=["fits", "small", "large", "mirrored", "aside"],
)
def test_doubts_about_a_scan(change, expected):
    found = scan_warnings(place(change), bright_template())
    by_name = {doubt.name: doubt for doubt in found}
    assert by_name.keys() >= expected.keys()
    assert bool(found) == bool(expected)
    for name, value in expected.items():
        assert value is None or by_name[name].value == pytest.approx(value)
    for doubt in found:  # a sentence states its value, and is the text of the object
        assert doubt.value is None or f"{doubt.value:.{0 if doubt.name == 'gap' else 2}f}" in doubt.text
        assert str(doubt) == doubt.text


def test_agreement_is_one_with_itself_and_blind_to_contrast():
    scan = place(np.eye(4)).volume
    assert agreement_with(scan, scan) == pytest.approx(1)
    assert agreement_with(scan.with_data(5 - 2 * scan.data), scan) == pytest.approx(-1)


def test_contrast_counts_inside_the_brain_alone():
    ground = np.zeros((24, 24, 24))
    ground[4:-4, 4:-4, 4:-4] = np.random.default_rng(0).uniform(0.5, 1, (16, 16, 16))
    template = Volume(ground, np.eye(4))
    assert contrast_with(template, template) == pytest.approx(1)
    assert contrast_with(template.with_data(np.where(ground > 0, 1.5 - ground, 0)), template) == pytest.approx(-1)
    assert agreement_with(template.with_data(np.where(ground > 0, 1.5 - ground, 0)), template) > 0.6
    other = np.random.default_rng(1).normal(size=ground.shape)
    found = contrast_with(template.with_data(other), template)
    rim = slice(7, -7), slice(7, -7), slice(7, -7)  # three voxels within the block
    assert found == pytest.approx(np.corrcoef(other[rim].ravel(), ground[rim].ravel())[0, 1])
    assert contrast_with(template.with_data(np.where(ground > 0, 1.0, 0.0)), template) == 0


def test_an_inverted_scan_is_doubted():
    template = bright_template()
    grid = place(np.eye(4))
    assert scan_warnings(grid, template) == []
    dark = np.where(grid.volume.data > 0.05, 1.3 - grid.volume.data, 0.0)
    (found,) = [
        w for w in scan_warnings(StandardScan(grid.volume.with_data(dark), np.eye(4)), template) if w.name == "contrast"
    ]
    assert "inside the brain the scan differs from a T1 (correlation -" in found.text
    assert found.value < 0


def test_a_stretched_scan_is_doubted():
    stretched = np.diag([1.0, 1.25, 1.0, 1.0])
    assert any("stretches one direction by 1.25" in w.text for w in scan_warnings(place(stretched), bright_template()))


def head(n_bright_cm3: float, n_values: int) -> Volume:
    """Some cm³ of bright voxels of 4 mm on a dark ground."""
    data = np.zeros((50, 50, 50))
    n_bright = round(n_bright_cm3 * 1000 / 64)
    data.reshape(-1)[:n_bright] = 100 + np.arange(n_bright) % n_values
    return Volume(data, np.diag([4.0, 4, 4, 1]))


@pytest.mark.parametrize(
    ("volume", "n_values", "words"),
    [
        (1200, 100, []),
        (600, 100, ["has 600 cm³"]),
        (2000, 100, ["has 2000 cm³"]),
        (1200, 1, ["2 different values"]),
        (110, 1, ["2 different values", "has 110 cm³"]),
    ],
)
def test_volume_and_values_of_a_scan(volume, n_values, words):
    found = volume_warnings(head(volume, n_values))
    assert len(found) == len(words)
    assert all(word in warning.text for word, warning in zip(words, found))


def test_doubts_about_surfaces():
    def masked(n_inside: int) -> Volume:
        return Volume((np.arange(1000) < n_inside).reshape(10, 10, 10), np.eye(4))

    def segmented(n_left: int) -> SegmentedSurface:
        return SegmentedSurface(ball, ball, masked(0), masked(500), masked(n_left))

    ball = icosphere(3, 40.0)
    calm = RepairedSurface(ball, 0, 0, 0.0)
    assert surface_warnings("left", ball, ball, segmented(495), calm) == []
    assert surface_warnings("left", ball, ball, segmented(495), None) == []
    (small,) = surface_warnings("left", icosphere(3, 30.0), icosphere(3, 30.0), segmented(500), calm)
    assert "left surface encloses 112 cm³" in small.text
    (large,) = surface_warnings("right", icosphere(3, 50.0), icosphere(3, 50.0), segmented(500), calm)
    assert "right surface encloses 519 cm³" in large.text
    (given_up,) = surface_warnings("right", ball, ball, segmented(480), calm)
    assert "20 voxels (4.0 %) of the right" in given_up.text
    (crossed,) = surface_warnings("left", ball, ball, segmented(500), RepairedSurface(ball, 64, 0, 0.31))
    assert "64 faces (5 %) of the left surface crossed after the flow" in crossed.text
    assert "backtracks" not in crossed.text
    assert surface_warnings("left", ball, ball, segmented(500), RepairedSurface(ball, 25, 0, 0.31)) == []  # 2 %
    (moved_back,) = surface_warnings("left", ball, ball, segmented(500), RepairedSurface(ball, 6, 2, 3.0))
    assert "2 backtracks" in moved_back.text
    assert surface_warnings("left", ball, ball, segmented(500), RepairedSurface(ball, 6, 0, 3.0)) == []
    (far,) = surface_warnings("left", ball, ball, segmented(500), RepairedSurface(ball, 6, 0, 8.5))
    assert "moved vertices by up to 8.5 mm" in far.text
    assert [w.name for w in (small, given_up, far)] == ["surface_volume", "voxels_given_up", "crossing_faces"]
    assert [w.value for w in (given_up, crossed)] == pytest.approx([0.04, 5.0])


def test_doubts_about_a_surface_of_any_system():
    """One that is smaller than the segmentation's, lies apart from it, or crosses itself and is not repaired."""
    mask = Volume(np.ones((10, 10, 10), bool), np.eye(4))
    ball = icosphere(3, 40.0)

    def warned(final, initial=ball):
        stages = SegmentedSurface(ball, ball, mask, mask, mask)
        found = surface_warnings("left", final, initial, stages, None)
        return {warning.name: warning for warning in found}

    assert warned(ball) == {}
    small = warned(ball, icosphere(3, 46.0))
    assert list(small) == ["surface_area", "segmentation_distance"]
    assert small["surface_area"].value == pytest.approx(float(face_areas(ball).sum()) / 100)
    assert "200 cm²" in small["surface_area"].text
    moved = ball.with_vertices(ball.vertices + torch.tensor([4.0, 0, 0]))
    apart = warned(moved)
    assert list(apart) == ["segmentation_distance"]
    assert apart["segmentation_distance"].value == pytest.approx(2.0, rel=0.05)  # |4 cos| over the sphere
    pulled = ball.vertices.clone()
    pulled[:8] = -0.9 * pulled[:8]  # through the opposite side
    crossing = warned(ball.with_vertices(pulled))
    assert crossing["crossing_faces"].value > 0.5
    assert "of the left surface cross others; 0.5 % or less" in crossing["crossing_faces"].text
