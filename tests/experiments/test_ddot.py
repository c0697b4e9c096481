"""The experiment on trained flows, on phantoms: what is missing is trained, then measured."""

import hashlib
import json
import math
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import yaml
from scipy import stats

from meshot.loss import surface_loss
from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.geometry import vertex_areas
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import Surface, vertex_distances
from meshot.provenance import read_results
from meshot.synth.cohorts import scans
from meshot.systems import get_system, read_settings
from meshot.systems.flows import DeformationExample
from meshot.volume.volume import Volume
from meshot_book.example_file import read_example
from meshot_book.trainings import processes
from nested import require_equal
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "ddot"
pytestmark = pytest.mark.usefixtures("one_thread")
SETTINGS = {
    "network": {"width": 4, "hidden": [8], "n_scales": 1, "size": 3},
    "training": {"n_epochs": 3, "learning_rate": 0.01, "n_faces": 400, "n_points": 500, "save_every": 1},
}


@pytest.fixture
def place(phantom_place, tmp_path, config):
    """A folder of one's own with everything but trainings, and a configuration of a few."""
    shutil.copytree(phantom_place, tmp_path, dirs_exist_ok=True)
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(SETTINGS))
    own = config | {
        "settings": str(tmp_path / "settings.yaml"),
        "cohorts": {"alpha": str(tmp_path / "alpha")},
        "segmentation": str(tmp_path / "segmentation.safetensors"),
        **{key: str(tmp_path / key) for key in ("initial", "state", "weights")},
        "evaluation": config["evaluation"] | {"n_points": 2000, "n_emd_points": 200, "closing_voxel_mm": 2.0},
        "groups": {
            "fair": {"cohorts": ["alpha"], "sides": ["left"], "arms": ["ddot", "cortexode"], "seeds": [0]},
            "seeds": {"cohorts": ["alpha"], "sides": ["left"], "arms": ["ddot"], "seeds": [0, 1]},
        },
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(own))
    return tmp_path


def chosen(part, config, only):
    trainings = part("trials.training")
    return trainings.chosen(trainings.finals(config), only)


def test_arms_differ_in_their_loss_alone(part, config, root, monkeypatch):
    monkeypatch.chdir(root)
    found = [each.settings(config).as_dict() for each in chosen(part, config, ["adni_like_left_*"])]
    losses = [each["loss"] for each in found]
    assert len({json.dumps(each | {"loss": None}) for each in found}) == 1
    assert len({(each["loss"], each["encoding"]) for each in losses}) == len(found) == 8
    chamfer = [each for each in losses if each["loss"] == "chamfer"]
    assert {each["encoding"] for each in chamfer} == {"samples", "varifold"}
    assert {each["factor"] for each in chamfer} == {1000}
    assert {each["n_supports"] for each in losses if each["loss"] == "sinkhorn"} == {500}
    others = [each.settings(config).as_dict()["training"] for each in chosen(part, config, ["oasis_like_*_ddot_*"])]
    assert [(each["side"], each["seed"]) for each in others] == [
        ("left", 0),
        ("right", 0),
        *[("left", i) for i in (1, 2, 3, 4)],
    ]


def test_an_unknown_name_is_refused(part, config):
    refuses("no training is called nobody; there are oasis_like_left_ddot_0", chosen, part, config, ["nobody"])


def test_what_is_missing_is_trained_and_kept(part, place, capsys):
    train, words = part("train"), ["--config", str(place / "config.yaml")]
    assert train.main([*words, "--only", "*_ddot_0"]) == 0
    assert train.main([*words, "--list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert listed == ["there    alpha_left_ddot_0", "missing  alpha_left_cortexode_0", "missing  alpha_left_ddot_1"]
    kept = {file.name for file in (place / "weights").iterdir()}
    assert kept == {f"alpha_left_ddot_0{suffix}" for suffix in (".safetensors", ".json", ".log.jsonl")}
    record = read_results(place / "weights" / "alpha_left_ddot_0.json")
    assert record["command"].startswith("meshot train ddot settings.yaml --data alpha ")
    assert record["command"].endswith("--set training.side=left training.seed=0")
    assert record["results"]["n_steps"] == 6
    before = (place / "weights" / "alpha_left_ddot_0.safetensors").stat().st_mtime_ns
    assert train.main(words) == 0
    assert (place / "weights" / "alpha_left_ddot_0.safetensors").stat().st_mtime_ns == before
    assert {file.stem for file in (place / "weights").glob("*.safetensors")} == {
        "alpha_left_ddot_0", "alpha_left_cortexode_0", "alpha_left_ddot_1",
    }  # fmt: skip


def test_a_training_that_fails_or_is_taken_does_not_stop_the_others(part, place, capfd, monkeypatch):
    train, trainings, words = part("train"), part("trials.training"), ["--config", str(place / "config.yaml")]
    monkeypatch.setattr(processes, "SECONDS_BETWEEN_LOOKS", 0.1)
    config = trainings.read_config(place / "config.yaml")
    config["arms"]["cortexode"]["changes"] = ["loss.factor=1.0e+39"]  # beyond float32
    (place / "config.yaml").write_text(yaml.safe_dump(config))
    assert train.main([*words, "--jobs", "2", "--only", "*_0"]) == 1
    assert "failed: alpha_left_cortexode_0;" in capfd.readouterr().err
    assert "is not finite" in (place / "state" / "alpha_left_cortexode_0" / "output.txt").read_text(encoding="utf-8")
    assert {file.stem for file in (place / "weights").glob("*.json")} == {"alpha_left_ddot_0"}
    taken = chosen(part, config, ["alpha_left_ddot_1"])[0]
    with processes.alone(taken.state(config)):
        assert train.main([*words, "--only", "*ddot*"]) == 1
    assert "alpha_left_ddot_1 is being trained by another process" in capfd.readouterr().err


def torus(large, small, n=96):
    """A closed ring around the third axis, normals outward; the first n vertices run around the tube."""
    around, along = torch.meshgrid(*[torch.arange(n, dtype=torch.float64) * 2 * math.pi / n] * 2, indexing="ij")
    out = large + small * along.cos()
    vertices = torch.stack([out * around.cos(), out * around.sin(), small * along.sin()], dim=2).reshape(-1, 3)
    i, j = (x.flatten() for x in torch.meshgrid(torch.arange(n), torch.arange(n), indexing="ij"))
    a, b, c, d = i * n + j, (i + 1) % n * n + j, (i + 1) % n * n + (j + 1) % n, i * n + (j + 1) % n
    return Mesh(vertices, torch.cat([torch.stack([a, b, c], dim=1), torch.stack([a, c, d], dim=1)]))


def test_every_training_gets_the_device(part, place, monkeypatch):
    train, used = part("train"), []
    monkeypatch.setattr(part("trials.train"), "require_device", lambda name: None)
    monkeypatch.setattr(part("trials.train"), "train_one", lambda each, config, device: used.append(device))
    assert train.main(["--config", str(place / "config.yaml"), "--device", "cuda"]) == 0
    assert set(used) == {"cuda"}


def test_the_hole_of_a_ring_is_as_deep_as_a_ball_leaves_it(part):
    large, small, radius = 12.0, 8.0, 10.0
    depths = part("measuring").sulcal_depths(torus(large, small), radius, 0.5).reshape(96, 96)
    # The ball rests on the ring, its centre on the axis at this height.
    height = math.sqrt((small + radius) ** 2 - large**2)
    deepest = math.hypot(large - small, height) - radius
    assert deepest > 3
    for place, exact in ((48, deepest), (0, 0.0), (24, 0.0)):
        assert depths[:, place].numpy() == pytest.approx(exact, abs=0.75)
        assert float(depths[:, place].mean()) == pytest.approx(exact, abs=0.35)


def test_curvature_has_the_sign_of_the_bend(part):
    found = part("measuring").signed_curvatures(torus(12.0, 8.0)).reshape(96, 96)
    for place, cosine in ((0, 1.0), (24, 0.0), (48, -1.0)):
        exact = (12 + 16 * cosine) / (2 * 8 * (12 + 8 * cosine))
        assert found[:, place].numpy() == pytest.approx(exact, rel=0.03)
    assert found[0, 48] < 0 < found[0, 0]


def test_errors_are_means_over_the_area_of_each_bin(part):
    ring = torus(12.0, 8.0)
    settings = {
        "closing_mm": 10.0, "closing_voxel_mm": 0.5, "depth_edges_mm": [1.0, 50.0], "curvature_edges": [0.0],
    }  # fmt: skip
    found = part("measuring").places(ring, settings)
    share = found.shares()
    assert sum(share["by_depth"]) == pytest.approx(1)
    assert share["by_depth"][2] == 0
    moved = ring.with_vertices(ring.vertices + torch.tensor([0.0, 0.0, 3.0]))
    errors = found.errors(moved)
    assert errors["by_depth"][2] is None
    whole = float(np.average(vertex_distances(ring, moved), weights=vertex_areas(ring).numpy()))
    for name, parts in errors.items():
        assert sum(e * s for e, s in zip(parts, share[name], strict=True) if e is not None) == pytest.approx(whole)
    assert float(found.areas.sum()) == pytest.approx(4 * math.pi**2 * 12 * 8, rel=0.01)


def test_what_is_there_is_measured_once_and_what_is_missing_named(part, place, monkeypatch, capsys):
    train, run, words = part("train"), part("run"), ["--config", str(place / "config.yaml")]
    output = ["--output", str(place / "out" / "results.json")]
    commits = ["first"]
    monkeypatch.setattr(run, "provenance", lambda: {"commit": commits[-1]})
    refuses("no trained network is in", run.main, [*words, *output])
    train.main([*words, "--only", "alpha_left_ddot_0", "alpha_left_cortexode_0"])
    calls = []
    for name in ("flow_row", "initial_row"):
        real = getattr(run, name)
        monkeypatch.setattr(run, name, lambda *a, real=real, name=name: calls.append(name) or real(*a))
    run.main([*words, *output])
    assert "1 networks are missing (train.py makes them): alpha_left_ddot_1" in capsys.readouterr().err
    assert calls == ["initial_row", "flow_row", "flow_row"] * 3
    first = read_results(place / "out" / "results.json")["results"]
    assert first["missing"] == ["alpha_left_ddot_1"]
    assert first["commits"] == ["first"]
    check_rows(first)
    train.main(words)
    calls.clear()
    commits.append("second")
    run.main([*words, *output])
    second = read_results(place / "out" / "results.json")["results"]
    assert calls == ["flow_row"] * 3
    assert second["commits"] == ["first", "second"]
    assert second["data_sha256"] == first["data_sha256"]
    assert second["missing"] == []
    assert [row for row in second["subjects"] if row["seed"] != 1] == first["subjects"]
    assert [each["name"] for each in second["trainings"]] == [
        "alpha_left_ddot_0", "alpha_left_cortexode_0", "alpha_left_ddot_1",
    ]  # fmt: skip
    for each in second["trainings"]:
        content = (place / "weights" / f"{each['name']}.safetensors").read_bytes()
        assert each["weights_sha256"] == hashlib.sha256(content).hexdigest()
    protocols = []
    monkeypatch.setattr(run.readings, "main", lambda words: protocols.append((words[1], words[3])))
    run.main([*words, *output])
    assert protocols == []
    run.main([*words, *output, "--all"])
    assert all(Path(config).is_file() for config, _ in protocols)
    assert [Path(file).relative_to(place / "out").as_posix() for _, file in protocols] == [
        f"{Path(config).stem}/results.json" for config, _ in protocols
    ]
    assert {Path(config).stem for config, _ in protocols} == {"readings", "candidates", "controls", "budget"}
    assert not (place / "out" / "partial.jsonl").exists()


def test_a_subject_made_anew_is_measured_anew(part, place):
    own = part("trials.training").read_config(place / "config.yaml")
    run, (each,) = part("run"), chosen(part, own, ["alpha_left_ddot_0"])
    each.kept(own, ".safetensors").parent.mkdir()
    each.kept(own, ".safetensors").write_bytes(b"weights")
    subjects = {"alpha": {subject.name: subject for subject in scans(place / "alpha", "test")}}
    surfaces = SimpleNamespace(network=torch.nn.Linear(2, 2))

    def setting():
        return run.Setting(own, [each], subjects, surfaces)

    def keys() -> set[str]:
        return {json.dumps(task) for task in run.tasks_of(setting())}

    before, first = setting().data, keys()
    assert len(first) == 6
    path = subjects["alpha"]["sub-005"].files()[0]
    path.write_bytes(path.read_bytes() + b" ")
    assert len(keys() & first) == 4
    assert setting().data["alpha"]["sub-004"] == before["alpha"]["sub-004"]


def check_rows(results):
    """Numbers that follow from others, or from what the phantoms are."""
    rows = {(row["subject"], row["arm"]): row for row in results["subjects"]}
    assert len(rows) == 9
    assert {row["kind"] for (subject, _), row in rows.items() if subject == "sub-006"} == {"procedural"}
    start, end = rows["sub-004", "initial"], rows["sub-004", "ddot"]
    assert 0.2 < start["measured"]["assd_mm"] < 1.5
    assert start["floors"]["assd_mm"] < 1e-9 < start["floors"]["swd_mm"] < start["floors"]["emd_mm"]
    assert end["repaired"]["euler_number"] == 2
    assert end["repaired"]["crossing_faces"] == 0
    assert end["cpu_seconds_flow"] > 0
    kinds = [(line["arm"], line["kind"], line["n_subjects"]) for line in results["summary"]]
    assert kinds == [(arm, kind, n) for kind, n in (("template", 2), ("procedural", 1)) for arm in ARMS]
    line = results["summary"][1]
    assert line["assd_mm"]["mean"] == pytest.approx(
        np.mean([rows[s, "ddot"]["repaired"]["assd_mm"] for s in ("sub-004", "sub-005")]), rel=1e-5
    )
    assert [(d["first"], d["second"], d["side"]) for d in results["differences"]] == [
        ("ddot", "cortexode", "left"), ("ddot", "initial", "left"), ("cortexode", "initial", "left"),
    ]  # fmt: skip
    assert results["seeds"] == []
    assert [line["arm"] for line in results["targets"]] == ["ddot", "cortexode"]


ARMS = ("initial", "ddot", "cortexode")


def test_networks_that_cannot_be_compared_are_refused(part, place):
    trainings, train = part("trials.training"), part("train")
    words = ["--config", str(place / "config.yaml")]
    train.main([*words, "--only", "alpha_left_ddot_0"])
    config = trainings.read_config(place / "config.yaml")
    each = trainings.finals(config)[0]
    with pytest.raises(ValueError, match="alpha_left_ddot_0 learned from initial surfaces of another"):
        each.checked_records(config, segmentation="0123")
    record = json.loads(each.kept(config, ".json").read_text(encoding="utf-8"))
    del record["config"]["loss"]["p"]  # a name that came later
    each.kept(config, ".json").write_text(json.dumps(record))
    assert each.checked_records(config)["left_white"]["results"]["best_step"] > 0
    config["arms"]["ddot"]["changes"] = ["training.n_epochs=4"]
    refuses("was trained with other settings than", each.checked_records, config)
    record["config"]["loss"]["loss"] = "nearest"
    each.kept(config, ".json").write_text(json.dumps(record))
    refuses(r"alpha_left_ddot_0.json: .*is invalid: loss is 'nearest'", each.checked_records, config)


def hemisphere(arm, seed, side, subject, assd, crossing=0.0):
    numbers = {"emd_mm": 6.0, "swd_mm": 2 * assd, "assd_mm": assd, "hausdorff90_mm": 3 * assd, "normals": 1 - assd}
    numbers |= {"crossing_faces": int(crossing), "crossing_percent": crossing, "euler_number": 2}
    numbers |= {"by_depth": [assd, None], "by_curvature": [assd]}
    row = {"cohort": "a", "side": side, "subject": subject, "kind": "template", "arm": arm, "seed": seed}
    if arm == "initial":
        share = {"by_depth": [1.0, 0.0], "by_curvature": [1.0]}
        return row | {"measured": numbers, "floors": {"emd_mm": 5.0}, "share": share}
    after = numbers | {"crossing_faces": 0, "crossing_percent": 0.0}
    seconds = {"cpu_seconds_flow": 1.0, "cpu_seconds_repair": 2.0}
    return row | {"flow": numbers, "repaired": after, "n_backtracks": 0, "largest_move_mm": 0.1} | seconds


SETTINGS_OF_SUMMARY = {
    "seed": 0, "n_resamples": 2000,
    "targets": {"share_of_initial": 0.5, "assd_mm": 0.3, "stretch_assd_mm": 0.2, "stretch_normals": 0.945},
}  # fmt: skip


COMPARED = {"ours": "ddot", "rival": "cortexode", "also": ["windowed"]}


def cohort_of(values, sides=("left", "right")):
    return [
        hemisphere(arm, seed, side, f"sub-{i}", value + (0.01 * i if arm != "initial" else 0.0))
        for arm, seed, value in values for side in sides for i in range(4)
    ]  # fmt: skip


def test_an_interval_is_that_of_all_resamples(part):
    values = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    interval = part("summary").resampled(values.tolist(), SETTINGS_OF_SUMMARY | {"n_resamples": 50000})
    every = np.mean(np.stack(np.meshgrid(*[values] * 6), axis=-1).reshape(-1, 6), axis=1)
    assert (interval["low"], interval["high"]) == pytest.approx(tuple(np.quantile(every, [0.025, 0.975])), rel=0.02)


def test_seeds_give_a_spread_and_students_interval(part):
    ours, rival = [0.2, 0.22, 0.21, 0.25, 0.19], [0.3, 0.28, 0.33, 0.31, 0.3]
    values = [("ddot", s, v) for s, v in enumerate(ours)] + [("cortexode", s, v) for s, v in enumerate(rival)]
    (line,) = part("summary").seeds(cohort_of([*values, ("ddot", 7, 9.0)], ["left"]), COMPARED)
    assert line["seeds"] == [0, 1, 2, 3, 4]
    interval = stats.ttest_rel(ours, rival).confidence_interval(0.95)
    found = line["assd_mm"]
    assert (found["low"], found["high"]) == pytest.approx(tuple(interval))
    assert found["ddot"]["sd"] == pytest.approx(np.std(ours, ddof=1))
    assert line["flow_crossing_percent"]["gap"] == line["flow_crossing_percent"]["high"] == 0
    assert part("summary").seeds(cohort_of(values[:5]), COMPARED) == []


def test_each_target_is_seen_to_be_missed(part):
    def of(assd):
        rows = cohort_of([("initial", None, 0.5), ("ddot", 0, assd)], ["left"])
        (line,) = part("summary").targets(rows, SETTINGS_OF_SUMMARY["targets"], COMPARED)
        return line

    names = ("enough_of_initial", "assd_reached", "stretch_assd_reached", "stretch_normals_reached")
    good, middle, bad = of(0.03), of(0.24), of(0.6)
    assert [good[name] for name in names] == [True] * 4
    assert [middle[name] for name in names] == [False, True, False, False]
    assert [bad[name] for name in names] == [False] * 4
    assert good["n_subjects_enough_of_initial"] == good["n_subjects"] == 4
    assert middle["n_subjects_enough_of_initial"] == 2
    assert set(good["better_than_initial"].values()) == {True}
    assert set(bad["better_than_initial"].values()) == {False}


def test_committed_results_follow_from_their_rows(part, record, results):
    config = record["config"]
    planned = [each.name for each in part("trials.training").finals(config)]
    assert sorted(results["missing"] + [each["name"] for each in results["trainings"]]) == sorted(planned)
    for each in results["trainings"]:
        assert (FOLDER / "weights" / f"{each['name']}.safetensors").is_file()
    again = part("summary").summarised(results["subjects"], config["evaluation"], config["comparison"])
    for table in ("targets", "differences", "seeds", "summary"):
        require_equal(again[table], results[table])


def test_the_kept_hemisphere_is_the_first_of_the_test_split(part, place):
    content = yaml.safe_load((place / "config.yaml").read_text(encoding="utf-8"))
    content["cohorts"] = {"oasis_like": content["cohorts"]["alpha"]}
    (place / "config.yaml").write_text(yaml.safe_dump(content))
    assert part("hold_out").main(["--config", str(place / "config.yaml"), "-o", str(place / "kept.safetensors")]) == 0
    example, record = read_example(place / "kept.safetensors")
    subject = scans(place / "alpha", "test")[0]
    assert example.name == f"alpha/{subject.name}" == "alpha/sub-004"
    assert (record["cohort"], record["side"]) == ("oasis_like", "left")
    assert len(self_intersecting_faces(example.initial)) == 0
    truth = Surface(subject.surface("white", "left", "standard"))
    assert np.abs(truth.offsets(Surface(example.target).sample(500, 0)).distances).max() < 0.05


@pytest.mark.parametrize("settings", ["shipped", "windows alone"])
def test_flows_of_the_package_are_trained_as_the_compared_ones_but_on_other_heads(part, config, root, settings):
    system, left = get_system("windows"), ["training.side=left"]
    (arm,) = chosen(part, config, ["oasis_like_left_windowed_0"])
    file, compared = {
        "shipped": ("shipped", read_settings(system, "combined", left)),
        "windows alone": (root / "experiments" / "people" / "windows_alone.yaml", arm.settings(config)),
    }[settings]
    found, compared = read_settings(system, file, left).as_dict(), compared.as_dict()
    assert (found["network"], found["loss"]) == (compared["network"], compared["loss"])
    # There are more of these heads, so that fewer epochs are needed.
    other = ("n_epochs", "validate_every")
    assert found["training"] == compared["training"] | {name: found["training"][name] for name in other}
    assert all(found["training"][name] < compared["training"][name] for name in other)


def test_every_record_that_is_kept_was_trained_as_the_configuration_says(part, config, root, monkeypatch):
    monkeypatch.chdir(root)
    there = [each for each in part("trials.training").finals(config) if each.is_made(config)]
    assert len(there) == len(list((FOLDER / "weights").glob("*.json"))) > 20
    for each in there:
        (record,) = each.checked_records(config).values()
        assert record["results"]["best_step"] > 0


def test_descent_directions_of_a_shifted_sphere_are_known(part):
    directions, ball = part("descent_directions"), icosphere(3)
    small, areas = ball.with_vertices(ball.vertices * 0.9), vertex_areas(ball)
    way = directions.needed(small, Surface(ball))
    outwards = ball.vertices * 0.1
    assert float((way - outwards).norm(dim=1).max()) < 0.01
    nearest = directions.descent_direction(surface_loss({"loss": "chamfer", "normal_scale": 0.0}), small, ball, 0)
    assert directions.cosine(nearest, way, areas) > 0.99
    assert directions.cosine(-nearest, 3 * way, areas) < -0.99
    turned = torch.stack([-outwards[:, 1], outwards[:, 0], 0 * areas], dim=1)
    assert abs(directions.cosine(turned, way, areas)) < 1e-3
    assert directions.affine_share(outwards + 5, ball, areas) == pytest.approx(1, abs=1e-9)
    waves = torch.sin(9 * ball.vertices[:, [1, 2, 0]])
    assert directions.affine_share(waves, ball, areas) < 0.2
    example = DeformationExample("ball", Volume(np.zeros((2, 2, 2)), np.eye(4)), small, small, ball)
    assert directions.initial_distance(example, 2000) == pytest.approx(0.1, abs=0.003)


def test_descent_directions_are_measured_on_validation_subjects(part, place):
    content = yaml.safe_load((place / "config.yaml").read_text(encoding="utf-8"))
    content["descent_directions"] |= {"n_faces": 200, "losses": {"a": {"n_directions": 5}, "b": {"loss": "chamfer"}}}
    (place / "config.yaml").write_text(yaml.safe_dump(content))
    assert (
        part("descent_directions").main(
            ["--config", str(place / "config.yaml"), "-o", str(place / "descent_directions.json")]
        )
        == 0
    )
    results = read_results(place / "descent_directions.json")["results"]
    assert [(row["subject"], row["loss"]) for row in results["rows"]] == [
        ("alpha/sub-003", "a"),
        ("alpha/sub-003", "b"),
    ]
    for row, mean in zip(results["rows"], results["means"], strict=True):
        assert mean == {key: value for key, value in row.items() if key != "subject"}
        assert 0 < row["area_over_target"] < 1
        assert 0.1 < row["initial_assd_mm"] < 3
