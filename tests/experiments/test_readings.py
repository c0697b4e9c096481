"""The readings of what the paper leaves open, on phantoms: rates, choice, whole trainings, stopped and gone on with."""

import functools
import itertools
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from meshot.flow import integrate
from meshot.loss import surface_loss
from meshot.mesh.connectivity import euler_number
from meshot.metrics import evaluate
from meshot.model import DeformationNetwork, read_weights
from meshot.pipeline import InitialSurfaces, in_scanner
from meshot.pipeline.initial_surface import segmented_surface
from meshot.provenance import read_results, write_results
from meshot.synth.cohorts import scans
from meshot.systems import deformed, hemisphere_example, standardised
from meshot.train import TrainingState
from meshot_book.trainings import processes
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "ddot"
pytestmark = pytest.mark.usefixtures("one_thread")
SETTINGS = {
    "network": {"width": 4, "hidden": [8], "n_scales": 1, "size": 3},
    "training": {"n_faces": 400, "n_points": 500, "save_every": 1},
}
#: The protocols with one folder of trainings.
SHARING = ("readings", "candidates", "controls")
EVALUATION = {"n_training": 1, "n_points": 500, "n_emd_points": 50}


@pytest.fixture(scope="module")
def protocol():
    return yaml.safe_load((FOLDER / "readings.yaml").read_text(encoding="utf-8"))


@pytest.fixture
def place(phantom_place, tmp_path, protocol):
    """A folder of one's own, and a protocol of three readings."""
    shutil.copytree(phantom_place, tmp_path, dirs_exist_ok=True)
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(SETTINGS))
    readings = {name: protocol["readings"][name] for name in ("ddot_20mm", "cortexode", "ddot_104mm")}
    own = protocol | {
        "settings": str(tmp_path / "settings.yaml"),
        "cohorts": {"alpha": str(tmp_path / "alpha")},
        "segmentation": str(tmp_path / "segmentation.safetensors"),
        "cohort": "alpha",
        "rate_epochs": 5,
        "epochs": 10,
        "readings": readings,
        "evaluation": protocol["evaluation"] | EVALUATION | {"cohort": str(tmp_path / "alpha")},
        **{key: str(tmp_path / key) for key in ("initial", "binary", "state", "weights", "short")},
    }
    (tmp_path / "readings.yaml").write_text(yaml.safe_dump(own))
    return tmp_path


def test_a_score_is_the_mean_of_the_second_half(part):
    found = [{"step": step, "validation_loss": float(step)} for step in (1, 2, 3, 4)]
    assert part("readings").score({"results": {"n_steps": 4, "validations": found}}) == 3.5


@pytest.mark.parametrize(
    ("name", "n_short", "arm", "group", "changed"),
    [
        ("readings", 33, "ddot_104mm_0.0001", "network", {"velocity_unit": 104}),
        ("candidates", 45, "windows_falling_0.002", "loss", {"last_window": 3}),
        ("controls", 18, "samples_mass_0.0005", "loss", {"detach_weights": False}),
        ("budget", 0, "ddot_wide_9", "training", {"learning_rate": 9.0}),
        ("paper_budget", 0, "ddot_paper_9", "training", {"learning_rate": 9.0}),
    ],
)
def test_every_reading_has_settings_of_its_own(part, root, monkeypatch, name, n_short, arm, group, changed):
    monkeypatch.chdir(root)
    readings, trainings, short, seen = part("readings"), part("trials.training"), {}, {}
    own = yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    for start in readings.STARTS:
        if there := readings.readings_from(own, start):
            short |= (arms := readings.rate_arms(own, start))
            arms |= {f"{each}_9": readings.arm_of(reading, 9.0, 1) for each, reading in there.items()}
            config = readings.configuration(own, start, arms, Path("a"), Path("b"))
            assert config["initial"] == own[start]
            seen |= {each.arm: each.settings(config).as_dict() | {"": start} for each in trainings.finals(config)}
    assert len(short) == n_short
    repeated = ("ddot_slow_0.0005", "ddot_slow_9") if name == "controls" else ()  # other rates of ddot_20mm
    assert len({json.dumps(each, sort_keys=True) for each in seen.values()}) == len(seen) - len(repeated)
    assert seen[arm][group].items() >= changed.items()
    assert set(own.get("finalists", {"always": []})["always"]) <= own["readings"].keys()
    rivals = {own["rival"], *(each.get("rival", own["rival"]) for each in own["readings"].values())}
    assert rivals <= own["readings"].keys()


def test_what_two_protocols_name_alike_is_the_same_training(part, root, monkeypatch):
    monkeypatch.chdir(root)
    readings, trainings = part("readings"), part("trials.training")
    places, seen, shared = set(), {}, set()
    for file in SHARING:
        own = yaml.safe_load((FOLDER / f"{file}.yaml").read_text(encoding="utf-8"))
        places.add(tuple(own[key] for key in ("state", "weights", "short", "cohort", "side", "seed", "initial")))
        short, whole = own["rate_epochs"], own["epochs"]
        arms = {
            f"{name} {n_epochs}": readings.arm_of(reading, 9.0, reading.get("epochs", n_epochs))
            for name, reading in own["readings"].items() for n_epochs in (short, whole) if n_epochs
        }  # fmt: skip
        config = readings.configuration(own, "initial", arms, Path("a"), Path("b"))
        for each in trainings.finals(config):
            text = json.dumps(each.settings(config).as_dict(), sort_keys=True)
            shared |= {each.arm} if each.arm in seen else set()
            assert seen.setdefault(each.arm, text) == text
    assert len(places) == 1
    assert {name.split()[0] for name in shared} == {"ddot_20mm", "cortexode", "chamfer_varifold"}


def test_protocols_that_share_trainings_run_one_after_another(root):
    tasks = yaml.safe_load((root / "workflow" / "experiments.yaml").read_text(encoding="utf-8"))["tasks"]
    assert all(earlier in tasks[later]["after"] for earlier, later in itertools.pairwise(SHARING))


def test_the_known_rates_are_those_of_the_comparison(root):
    own = yaml.safe_load((FOLDER / "budget.yaml").read_text(encoding="utf-8"))
    chosen = read_results(root / "experiments" / "comparison" / "rates.json")["results"]
    for arm in ("ddot", "cortexode"):
        assert own["rates"][arm] == [chosen[arm]["rate"]]


def test_the_budget_of_the_paper_differs_from_the_wide_networks_in_the_number_of_steps(part, root, monkeypatch):
    monkeypatch.chdir(root)
    readings, trainings = part("readings"), part("trials.training")
    wide, paper = (trainings.read_config(FOLDER / f"{name}.yaml") for name in ("budget", "paper_budget"))
    for system in ("ddot", "cortexode"):
        arms = {
            name: readings.arm_of(own["readings"][name], 1e-4, 7)
            for own, name in ((wide, f"{system}_wide"), (paper, f"{system}_paper"))
        }
        config = readings.configuration(paper, "initial", arms, Path("a"), Path("b"))
        first, second = (each.settings(config).as_dict() for each in trainings.finals(config))
        assert first == second
    assert round(paper["epochs"] * 28, -2) == 90_000


def test_finalists_are_the_best_and_those_that_always_are(part, protocol):
    found = {
        name: {"assd_mm": {"0.002": score, "0.005": score + 1}}
        for name, score in {"rival": 0.9, "a": 0.4, "b": 0.2, "c": 0.3}.items()
    }
    finalists = part("readings").finalists
    assert finalists(found, {"finalists": {"number": 2, "always": ["rival"]}}) == ["rival", "b", "c"]
    assert finalists(found, protocol) == ["rival", "a", "b", "c"]
    found["known"] = {"assd_mm": {}}
    assert finalists(found, {"finalists": {"number": 1, "always": []}}) == ["b", "known"]


@pytest.mark.thorough  # test_comparison.py trains everything of the trial by the same code
def test_the_best_rate_of_each_reading_is_trained_to_the_end(part, place):
    readings = part("readings")
    words = ["--config", str(place / "readings.yaml"), "-o", str(place / "readings.json")]
    assert readings.main(words) == 0
    record = read_results(place / "readings.json")
    found = record["results"]["rates"]
    assert set(found) == {"ddot_20mm", "cortexode", "ddot_104mm"}
    own_seconds = [read_results(file)["results"]["cpu_seconds"] for file in place.glob("*/**/*_0.json")]
    assert len(own_seconds) == 12
    assert record["seconds"] > sum(own_seconds)  # and those of the measurements
    measured(part, place, record["results"])
    courses = {each["arm"]: each for each in record["results"]["trainings"]}
    assert set(courses) == set(found)
    for name, each in found.items():
        assert each["rate"] == float(min(each["assd_mm"], key=each["assd_mm"].get))
        record = read_results(place / "weights" / f"alpha_left_{name}_0.json")
        assert record["results"]["n_steps"] == 20
        assert record["config"]["training"]["learning_rate"] == each["rate"]
        assert courses[name]["step"] == list(range(4, 21, 4))
        assert min(zip(courses[name]["assd_mm"], courses[name]["step"]))[1] == record["results"]["best_step"]
    before = {file: file.stat().st_mtime_ns for file in (place / "weights").iterdir()}
    assert readings.main(words) == 0
    assert {file: file.stat().st_mtime_ns for file in (place / "weights").iterdir()} == before


def measured(part, place, results):
    """The rows are what the kept weights give, measured by hand, and the tables follow from the rows."""
    rows = {(r["split"], r["subject"], r["arm"], r["weights"]): r for r in results["subjects"]}
    alpha = {split: scans(place / "alpha", split) for split in ("train", "validation", "test")}
    n_scans = 1 + len(alpha["validation"]) + len(alpha["test"])
    assert len(rows) == len(results["subjects"]) == n_scans * (1 + 2 * 3)
    subject, network = (
        alpha["test"][-1],
        part("trials.training").segmentation_network({"segmentation": str(place / "segmentation.safetensors")}),
    )
    keys = [("left", "white")]
    example = InitialSurfaces(place / "initial", network).example(subject, keys, keys)
    example, scan, truth = (
        hemisphere_example(example, "left", 400),
        subject.standard(),
        subject.surface("white", "left"),
    )
    for which, ending in (("best", ".safetensors"), ("last", ".last.safetensors")):
        own, record = read_weights(place / "weights" / f"alpha_left_ddot_104mm_0{ending}", DeformationNetwork)
        found = rows["test", subject.name, "ddot_104mm", which]
        surface = in_scanner(deformed(example.initial, example.scan, own), scan)
        assert found["assd_mm"] == pytest.approx(float(evaluate(surface, truth, 500, 0, 50).assd.value), rel=1e-3)
        loss = surface_loss(record["loss"])
        # As in a training: the image is standardised over the whole initial surface, not over the coarse one.
        field = own.velocity_in(standardised(example.scan, example.initial))
        after = example.coarse.with_vertices(integrate(field, example.coarse.vertices, 10).detach())
        for name, mesh in (("before", example.coarse), ("after", after)):
            expected = float(loss(mesh, example.target, np.random.default_rng(0)))
            assert found[f"loss_{name}"] == pytest.approx(expected, rel=1e-3)
    state = TrainingState.read_last_weights(place / "state" / "alpha_left_ddot_104mm_0" / "state" / "left_white")
    assert all(torch.equal(value, state[name]) for name, value in own.state_dict().items())
    start = rows["test", subject.name, "start", None]
    by_hand = evaluate(in_scanner(example.initial, scan), truth, 500, 0, 50)
    assert start["normals"] == pytest.approx(float(by_hand.normals.value), rel=1e-3)
    assert {(m["arm"], m["weights"], m["split"]) for m in results["means"]} == {(r[2], r[3], r[0]) for r in rows}


def reading_row(arm, which, subject, value, **more):
    row = {"start": "initial", "arm": arm, "weights": which, "split": "test", "subject": subject, "kind": "template"}
    metrics = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "crossing_faces", "crossing_percent", "euler_number")
    return row | dict.fromkeys(metrics, value) | {"normals": 1 - value} | more


def test_a_loss_helps_if_it_is_nearer_than_its_start_and_beats_if_nearer_than_its_rival(part):
    table, rows = part("reading_rows"), []
    for k, noise in enumerate((0.001, -0.001, 0.002, -0.002)):
        name = f"s{k}"
        rows += [reading_row("start", None, name, 0.3 + noise)]
        rows += [reading_row("start", None, name, 0.1, start="binary")]
        for which, ours in (("best", 0.25), ("last", 0.3)):
            rows += [reading_row("a", which, name, ours - noise), reading_row("rival", which, name, 0.28)]
            rows += [reading_row("b", which, name, 0.35 + noise, start="binary")]
        rows += [
            reading_row("a", "best", name, 9.0, kind="procedural"),
            reading_row("a", "best", name, 9.0, split="train"),
        ]
    readings = {"a": {}, "rival": {}, "b": {"rival": "a"}}
    failed = table.tables(
        [*rows, reading_row("a", "best", "s9", 0.0) | {"failed": "it is not finite"}], readings, "rival"
    )
    found = table.tables(rows, readings, "rival")
    assert found["decided"] == {
        "a": {"best": {"helps": True, "beats": True}, "last": {"helps": False, "beats": False}},
        "rival": {"best": {"helps": True}, "last": {"helps": True}},
        "b": {"best": {"helps": False, "beats": False}, "last": {"helps": False, "beats": False}},
    }
    (gap,) = (g for g in found["differences"] if (g["first"], g["second"], g["weights"]) == ("b", "a", "best"))
    assert gap["n_subjects"] == 4
    assert gap["assd_mm"]["gap"] == pytest.approx(0.1)
    nothing = {"best": {"helps": False, "beats": False}}
    assert failed["decided"] == found["decided"] | {"a": found["decided"]["a"] | nothing}
    (mean,) = (
        m for m in failed["means"]
        if (m["arm"], m["weights"], m["split"], m["kind"]) == ("a", "best", "test", "template")
    )  # fmt: skip
    assert (mean["n_subjects"], mean["n_failed"]) == (4, 1)
    assert mean["assd_mm"]["mean"] == pytest.approx(0.25)


def test_a_single_rate_is_not_tried(part, place):
    readings = part("readings")
    own = yaml.safe_load((place / "readings.yaml").read_text(encoding="utf-8"))
    own |= {"rates": {"mm": [0.002]}, "readings": {"cortexode": own["readings"]["cortexode"]}}
    own["readings"]["cortexode"]["epochs"], own["validate_every"] = 4, 3
    rates, whole, _ = readings.train_readings("initial", own)
    assert rates == {"cortexode": {"rate": 0.002, "assd_mm": {}}}
    assert whole["arms"]["cortexode"]["changes"][-2:] == ["training.n_epochs=4", "training.validate_every=3"]
    assert read_results(place / "weights" / "alpha_left_cortexode_0.json")["results"]["n_steps"] == 8
    assert not (place / "short").exists()


def test_a_rate_without_an_end_is_not_chosen(part, place, protocol):
    readings = part("readings")
    own = yaml.safe_load((place / "readings.yaml").read_text(encoding="utf-8")) | {
        "rates": {"mm": [0.002, 1.0], "unit": []}
    }
    config = readings.configuration(own, "initial", {}, place / "state", place / "kept")
    (place / "kept").mkdir()
    found = {"n_steps": 2, "validations": [{"step": 2, "validation_loss": 0.3}]}
    write_results(place / "kept" / "alpha_left_ddot_20mm_0.002_0.json", found, {}, "none", "none", 0.0)
    assert readings.scores(own, "ddot_20mm", config) == {0.002: 0.3}


@pytest.fixture
def diverging(part, place):
    """A configuration with one training whose loss overflows."""
    readings, own = part("readings"), yaml.safe_load((place / "readings.yaml").read_text(encoding="utf-8"))
    reading = {"system": "cortexode", "changes": ["loss.factor=1.0e+39"]}
    arms = {"cortexode_0.002": readings.arm_of(reading, 0.002, 5)}
    return readings.configuration(own, "initial", arms, place / "state", place / "kept")


def test_a_reading_without_a_rate_is_refused(part, place, diverging):
    readings, own = part("readings"), yaml.safe_load((place / "readings.yaml").read_text(encoding="utf-8"))
    assert readings.train_arms(diverging, place / "rates.yaml") == 0
    found = readings.scores(own | {"rates": {"mm": [0.002]}}, "cortexode", diverging)
    with pytest.raises(ValueError, match="cortexode: no rate kept a finite loss; give the reading smaller rates"):
        readings.choice(found, "cortexode")


def test_a_training_that_another_process_has_is_not_taken_for_diverged(part, place, diverging):
    readings, trainings = part("readings"), part("trials.training")
    (each,) = trainings.finals(diverging)
    with (
        processes.alone(each.state(diverging)),
        pytest.raises(processes.Busy, match="is being trained by another process"),
    ):
        readings.train_arms(diverging, place / "rates.yaml")


def test_the_second_try_is_on_the_same_device(part, place, diverging, monkeypatch):
    readings, tried = part("readings"), []
    monkeypatch.setattr(readings.train, "main", lambda words: 1)
    monkeypatch.setattr(readings, "train_one", lambda each, config, device: tried.append(device))
    readings.train_arms(diverging, place / "rates.yaml", device="cuda")
    assert tried == ["cuda"]


def test_a_kept_training_with_other_settings_is_refused(part, place):
    readings = part("readings")
    own = yaml.safe_load((place / "readings.yaml").read_text(encoding="utf-8"))
    own |= {"rates": {"mm": [0.002]}, "readings": {"cortexode": own["readings"]["cortexode"]}, "epochs": 1}
    readings.train_readings("initial", own)
    own["readings"]["cortexode"]["changes"] = ["training.n_points=400"]
    refuses(r"alpha_left_cortexode_0\.json was trained with other settings", readings.train_readings, "initial", own)


def test_binary_surfaces_come_from_the_mask_alone(part, place, monkeypatch):
    readings = part("readings")
    network = part("trials.training").segmentation_network({"segmentation": str(place / "segmentation.safetensors")})
    surfaces = readings.InitialSurfaces(place / "binary", network)
    (subject,) = scans(place / "alpha", "validation")

    def ball(scan, network, slope=1.0):
        grid = np.stack(np.meshgrid(*(np.arange(n) for n in scan.data.shape), indexing="ij"), axis=-1)
        radius = np.linalg.norm(grid - np.array(scan.data.shape) / 2, axis=-1)
        return dict.fromkeys(("left", "right"), scan.with_data(1 / (1 + np.exp(slope * (radius - 7.3)))))

    monkeypatch.setattr(readings, "segment", ball)
    readings.write_binary_surfaces([subject], surfaces)
    first = surfaces.of(subject, "left")
    assert euler_number(first) == 2
    # The slope of the probability tells where between two voxels the border lies. A mask does not hold it.
    monkeypatch.setattr(readings, "segment", functools.partial(ball, slope=0.2))
    for path in place.glob("binary/**/*.gii"):
        path.unlink()
    readings.write_binary_surfaces([subject], surfaces)
    assert torch.equal(surfaces.of(subject, "left").vertices, first.vertices)
    both = [
        segmented_surface(ball(subject.standard().volume, None, slope)["left"]).mesh.vertices for slope in (1.0, 0.2)
    ]
    assert both[0].shape != both[1].shape or (both[0] - both[1]).abs().max() > 1e-3


def test_binary_surfaces_that_exist_are_kept(part, place, monkeypatch):
    readings = part("readings")
    network = part("trials.training").segmentation_network({"segmentation": str(place / "segmentation.safetensors")})
    monkeypatch.setattr(readings, "segment", lambda *_: 1 / 0)
    readings.write_binary_surfaces(
        scans(place / "alpha", "validation"), readings.InitialSurfaces(place / "initial", network)
    )


def test_claim_17_is_computed_from_every_protocol_that_has_results(root):
    (row,) = (each for each in yaml.safe_load((root / "book" / "claims.yaml").read_text("utf-8")) if each["id"] == 17)
    there = {f"ddot/{each.stem}" for each in FOLDER.glob("*.yaml") if (FOLDER / each.stem / "results.json").is_file()}
    assert {row["experiment"], *row["also"]} == there
