"""The protocol of the warnings: limits and shares on numbers whose answer is known, and each kind of spoiled scan."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from meshot.pipeline import quality_numbers
from meshot.provenance import write_results
from meshot.volume.volume import Volume

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "warnings"
CONFIG, FURTHER = (
    yaml.safe_load((FOLDER / name).read_text(encoding="utf-8")) for name in ("config.yaml", "further.yaml")
)


BAD = {"gap": "high", "contrast": "low", "scale": "either", "idle": "high"}


def numbers(gap=1.0, contrast=0.8, scale=1.0, idle=0.0):
    return {"gap": gap, "contrast": contrast, "scale": scale, "idle": idle}


def test_a_limit_is_the_extreme_of_the_good_ones_moved_by_their_range(run):
    good = [numbers(gap=1, contrast=0.5, scale=0.9), numbers(gap=3, contrast=0.7, scale=1.1)]
    limits = run.limits_of(good, BAD)
    assert limits["gap"] == (None, 5)
    assert limits["contrast"] == (pytest.approx(0.3), None)
    assert limits["scale"] == (pytest.approx(0.7), pytest.approx(1.3))
    assert run.beyond(numbers(gap=5, contrast=0.31, scale=1.29), limits) == []
    assert run.beyond(numbers(gap=5.1, contrast=0.29, scale=0.69), limits) == ["gap", "contrast", "scale"]
    assert run.beyond(numbers(gap=float("nan")), limits) == ["gap"]


def test_heads_of_the_judgement_have_no_part_in_the_limits(run):
    def row(head, flag, assd, **values):
        return {
            "head": head, "spoiled": flag, "assd_mm": {"left": assd, "right": 0.2},
            "numbers": numbers(**values), "warning_names": ["contrast"],
        }  # fmt: skip

    rows = [
        row(0, False, 0.3, gap=1), row(0, True, 3.0, gap=9), row(1, False, 0.3, gap=2), row(1, True, 3.0, gap=2),
        row(2, False, 0.3, gap=8), row(2, True, 2.0, gap=9), row(3, False, 0.9, gap=8),
        {"head": 3, "spoiled": True, "refused": "no"}, row(4, True, 0.4, gap=1), row(4, False, 0.3, gap=2.5),
    ]  # fmt: skip
    found = run.judged(rows, {"n_choice": 2, "useful_mm": 0.6, "bad": BAD})
    assert found["limits"] == {"gap": (None, 3)}
    assert found["dropped"] == ["contrast", "idle", "scale"]
    shares = found["shares"]
    good, spoiled = (shares[f"judgement, {key}, counted"]["new"] for key in ("good", "spoiled"))
    assert (good["warned"], good["of"]) == (1, 2)  # the third is no good result
    assert (spoiled["warned"], spoiled["of"]) == (2, 2)  # one is refused; one did no harm
    assert shares["judgement, spoiled, all"]["new"]["of"] == 3
    assert shares["judgement, good, counted"]["before"]["share"] == 1


def test_all_heads_of_an_earlier_run_choose_in_the_second(run, tmp_path):
    def row(head, flag, **values):
        return {"head": head, "spoiled": flag, "assd_mm": {"left": 0.3}, "numbers": numbers(**values),
                "warning_names": []}  # fmt: skip

    earlier = [row(0, False, gap=1), row(1, False, gap=2), row(2, False, gap=4), row(2, True, gap=9)]
    write_results(tmp_path / "first.json", {"rows": earlier}, {}, "python", "heads", 1.0)
    now = [row(0, False, gap=6.5), row(0, True, gap=7.5), row(1, False, gap=50)]
    second = {"choice": str(tmp_path / "first.json"), "n_choice": 0, "useful_mm": 0.6, "bad": BAD}
    found = run.judged(now, second)
    assert found["limits"] == {"gap": (None, 7)}
    assert found["shares"]["choice, good, all"]["new"]["of"] == 3
    good = found["shares"]["judgement, good, all"]["new"]
    assert (good["warned"], good["of"]) == (1, 2)


def test_shares_have_exact_intervals(run):
    found = run.share([False] * 16)
    assert found["low"] == 0
    assert found["high"] == pytest.approx(1 - 0.025 ** (1 / 16))  # Clopper and Pearson
    assert run.share([])["share"] is None


@pytest.fixture
def head():
    """Two boxes of white matter in grey matter, and fluid, in air."""
    labels = np.zeros((24, 20, 20), dtype=np.uint8)
    labels[2:22, 3:17, 3:17] = 7
    labels[3:12, 4:16, 4:16], labels[12:21, 4:16, 4:16] = 3, 4
    labels[5:11, 6:14, 6:14], labels[13:19, 6:14, 6:14] = 1, 2
    levels = np.array([2.0, 400, 400, 300, 300, 0, 0, 90])
    return Volume(levels[labels].astype(np.float32), np.eye(4)), labels


def test_each_kind_of_spoiled_scan_is_what_it_says(run, head):
    scan, labels = head
    made = {}
    for how in CONFIG["spoiled"] + FURTHER["spoiled"]:
        sizes = {key: value for key, value in how.items() if key != "kind"}
        sizes |= {"mm": 4} if how["kind"] in ("cropped", "thick", "lesion") else {}
        made[how["kind"]] = run.KINDS[how["kind"]](scan, labels, np.random.default_rng(0), **sizes)
    assert set(made) == set(run.KINDS)
    white, grey, fluid, air = (np.isin(labels, each) for each in ((1, 2), (3, 4), (7,), (0,)))

    def mean(kind, part):
        return made[kind][0].data[part].mean()

    assert mean("inverted", fluid) > mean("inverted", grey) > mean("inverted", white)
    assert mean("inverted", air) == 2
    assert mean("bright_fluid", fluid) > mean("bright_fluid", white) > mean("bright_fluid", grey)
    assert mean("one_side", labels == 2) == 2
    assert mean("one_side", labels == 1) == 400
    heights = np.indices(labels.shape)[2]
    assert mean("cropped", white & (heights > 9)) == 2
    assert mean("cropped", white & (heights <= 9)) == 400
    inside = labels != 0
    field = np.log(made["biased"][0].data[inside] / scan.data[inside])
    assert field.std() == pytest.approx(0.6, rel=0.02)
    assert (made["noisy"][0].data - scan.data)[white].std() == pytest.approx(100, rel=0.1)
    slices = made["thick"][0]
    assert slices.data.shape == (24, 20, 5)
    assert slices.affine[2, 2] == 4
    assert slices.affine[2, 3] == 1.5
    np.testing.assert_allclose(slices.data[..., 1], scan.data[..., 4:8].mean(axis=2), rtol=1e-6)
    turned, moved = made["turned"]
    np.testing.assert_allclose(turned.affine, moved @ scan.affine)
    ball = made["lesion"][0].data != scan.data
    assert 0.8 * 4 / 3 * np.pi * 4**3 < ball.sum() < 1.2 * 4 / 3 * np.pi * 4**3
    assert ball[white].any()
    assert set(made["lesion"][0].data[ball]) == {90.0}
    bright = made["vessels"][0].data != scan.data
    assert bright.sum() == pytest.approx(0.25 * fluid.sum(), rel=0.02)
    assert not bright[~fluid].any()
    assert set(made["vessels"][0].data[bright]) == {640.0}
    smaller, moved = made["child"]
    np.testing.assert_allclose(smaller.affine, moved @ scan.affine)
    assert np.linalg.det(smaller.affine[:3, :3]) == pytest.approx(0.75**3)
    assert all((made[kind][1] == np.eye(4)).all() for kind in made if kind not in ("turned", "child"))


def test_each_way_has_an_outcome(run, monkeypatch):
    right = {"assd_mm": {"left": 0.2, "right": 0.5}, "warning_names": []}
    wrong = right | {"assd_mm": {"left": 0.2, "right": 0.7}}
    found = [right, wrong, wrong | {"warning_names": ["gap"]}, right | {"warning_names": ["gap"]}, {"refused": "no"}]
    config = {"useful_mm": 0.6, "every": True, "n_heads": 5, "spoiled": [{"kind": "lesion", "mm": 25}]}
    monkeypatch.setattr(run, "digests_of", lambda _: {})
    tasks = run.tasks(config)
    assert [(task["head"], task["way"]) for task in tasks] == [(k, 0) for k in range(5)]
    rows = [{"task": task, "found": each} for task, each in zip(tasks, found, strict=True)]
    made = run.results(rows, config)
    assert made["outcomes"] == {"lesion 25": ["right", "wrong without a word", "warned of", "warned of", "refused"]}


def test_the_protocol_knows_every_number_of_the_package():
    """Its numbers are those of :func:`meshot.pipeline.quality_numbers`, here of a bright ball in the dark."""
    from meshot.mesh.shapes import icosphere
    from meshot.pipeline.initial_surface import SegmentedSurface
    from meshot.pipeline.reconstruction import HemisphereSurface
    from meshot.volume.registration import StandardScan

    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = -49
    away = np.linalg.norm(np.indices((50, 50, 50)) * 2.0 - 49, axis=0)
    scan = Volume(np.clip((38 - away) / 20, 0, 1), affine)
    mask = scan.with_data(away < 36)
    fewer = mask.with_data(mask.data & (away > 6))
    ball = icosphere(4, 36.0)
    ball = ball.with_vertices(ball.vertices.double())

    def side(mesh):
        return HemisphereSurface(ball, mesh, SegmentedSurface(ball, ball, mask, mask, fewer), None)

    large = ball.with_vertices(1.02 * ball.vertices)
    found = quality_numbers(
        scan, StandardScan(scan, np.diag([1.1, 1.0, 1.0, 1.0])), scan, {"left": side(ball), "right": side(large)}
    )
    assert set(found) == set(CONFIG["bad"])
    assert found["voxel_mm"] == 2
    assert found["stretch"] == pytest.approx(1.1)
    assert found["scale"] == pytest.approx(1.1 ** (1 / 3))
    assert found["side_ratio"] == pytest.approx(1.02**3)
    assert found["largest_area_over_initial"] == pytest.approx(1.02**2)
    assert found["least_area_over_initial"] == pytest.approx(1)
    assert found["brighter_inside"] == 1
    assert found["contrast"] == pytest.approx(1)
    assert found["gap_cm3"] == 0
    assert found["given_up"] == pytest.approx(1 - fewer.data.sum() / mask.data.sum())
    assert found["from_segmentation_mm"] == pytest.approx(0.72, rel=0.02)
    dark = quality_numbers(scan.with_data(1 - scan.data), StandardScan(scan, np.eye(4)), scan, {"left": side(ball)})
    assert dark["brighter_inside"] == 0
    assert dark["step"] < 0
