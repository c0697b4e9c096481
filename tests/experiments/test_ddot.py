"""The experiment on trained flows, on phantoms: trainings in their order, stopped and gone on with, then measured."""

import json
import shutil
from pathlib import Path

import pytest
import torch
import yaml

from meshot.mesh.io import write_mesh
from meshot.mesh.smoothing import laplacian_smoothing
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights, write_weights
from meshot.pipeline.deformation_data import InitialSurfaces
from meshot.report.results import read_results
from meshot.synth.cohort import scans
from phantoms import write_phantom_cohort

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "ddot"
pytestmark = pytest.mark.usefixtures("one_thread")
SETTINGS = {
    "network": {"width": 4, "hidden": [8], "n_scales": 1, "size": 3},
    "loss": {"n_directions": 10},
    "training": {"n_epochs": 3, "learning_rate": 0.01, "n_faces": 400, "n_points": 500, "save_every": 1},
}


@pytest.fixture(scope="module")
def prepared_place(tmp_path_factory):
    """A phantom cohort with its initial surfaces: the true ones without folds, half a millimetre too small."""
    place = tmp_path_factory.mktemp("ddot")
    cohort = write_phantom_cohort(place / "alpha", ["train", "train", "validation", "test", "test", "test"])
    table = (cohort / "participants.tsv").read_text().splitlines()
    table[-1] = table[-1].replace("template", "procedural")
    (cohort / "participants.tsv").write_text("\n".join(table) + "\n")
    network = SegmentationNetwork(2, 1, generator=0)
    write_weights(place / "segmentation.safetensors", network, {})
    folder = InitialSurfaces(place / "initial", network.float()).folder
    for subject in scans(cohort):
        for side in ("left", "right"):
            smooth = laplacian_smoothing(subject.surface("white", side, "standard"), 10)
            centre = smooth.vertices.mean(dim=0)
            initial = smooth.with_vertices(centre + 0.94 * (smooth.vertices - centre))
            write_mesh(folder / "alpha" / f"{subject.name}_{side}.surf.gii", initial)
    return place


@pytest.fixture
def place(prepared_place, tmp_path, config):
    """A folder of one's own with everything but trainings, and a configuration of a few."""
    shutil.copytree(prepared_place, tmp_path, dirs_exist_ok=True)
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(SETTINGS))
    own = config | {
        "settings": str(tmp_path / "settings.yaml"),
        "cohorts": {"alpha": str(tmp_path / "alpha")},
        "segmentation": str(tmp_path / "segmentation.safetensors"),
        **{key: str(tmp_path / key) for key in ("initial", "state", "weights")},
        "groups": {
            "fair": {"cohorts": ["alpha"], "sides": ["left"], "arms": ["ddot", "cortexode"], "seeds": [0]},
            "seeds": {"cohorts": ["alpha"], "sides": ["left"], "arms": ["ddot"], "seeds": [0, 1]},
        },
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(own))
    return tmp_path


def weights(place, name):
    return read_weights(place / "weights" / f"{name}.safetensors", DeformationNetwork)[0].state_dict()


def test_the_fair_pairs_come_first_and_nothing_is_made_twice(part, config):
    names = [each.name for each in part("trainings").wanted(config)]
    assert len(names) == len(set(names)) == 21
    assert names[:4] == [f"oasis_like_{side}_{arm}_0" for side in ("left", "right") for arm in ("ddot", "cortexode")]
    assert all(name.split("_like_")[1].split("_", 1)[1] in ("ddot_0", "cortexode_0") for name in names[:8])
    assert sum(name.startswith("oasis_like_left_ddot") for name in names) == 5
    assert sum(name.startswith("adni_like_left") and name.endswith("_0") for name in names) == 7


def test_arms_differ_in_their_loss_alone(part, config, root, monkeypatch):
    monkeypatch.chdir(root)
    found = [each.settings(config) for each in part("trainings").wanted(config, ["adni_like_left_*"])]
    assert len({json.dumps(each.network) for each in found}) == 1
    assert len({each.training for each in found}) == 1
    assert len({(each.loss.loss, each.loss.encoding) for each in found}) == len(found) == 7
    fair = {each.loss.loss: each.loss for each in found if each.loss.n_supports is None}
    assert fair["chamfer"].factor == 1000
    assert {each.loss.n_supports for each in found if each.loss.loss == "sinkhorn"} == {500}


def test_an_unknown_name_is_refused(part, config):
    with pytest.raises(ValueError, match="no training is called nobody; there are oasis_like_left_ddot_0"):
        part("trainings").wanted(config, ["nobody"])


def test_what_is_missing_is_trained_and_kept(part, place, capsys):
    train, words = part("train"), ["--config", str(place / "config.yaml")]
    assert train.main([*words, "--only", "*_ddot_0"]) == 0
    assert train.main([*words, "--list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert listed == ["there    alpha_left_ddot_0", "missing  alpha_left_cortexode_0", "missing  alpha_left_ddot_1"]
    kept = {file.name for file in (place / "weights").iterdir()}
    assert kept == {f"alpha_left_ddot_0{suffix}" for suffix in (".safetensors", ".json", ".log.jsonl")}
    record = read_results(place / "weights" / "alpha_left_ddot_0.json")
    assert record["command"].endswith(
        "--set loss.loss=sliced loss.encoding=varifold training.side=left training.seed=0"
    )
    assert record["results"]["n_steps"] == 6
    before = (place / "weights" / "alpha_left_ddot_0.safetensors").stat().st_mtime_ns
    assert train.main(words) == 0
    assert (place / "weights" / "alpha_left_ddot_0.safetensors").stat().st_mtime_ns == before
    assert {file.stem for file in (place / "weights").glob("*.safetensors")} == {
        "alpha_left_ddot_0", "alpha_left_cortexode_0", "alpha_left_ddot_1",
    }  # fmt: skip


def test_a_stopped_training_ends_with_the_same_weights(part, place, monkeypatch):
    from meshot.pipeline import training

    train, words = part("train"), ["--config", str(place / "config.yaml"), "--only", "alpha_left_ddot_1"]
    train.main(words)
    whole = weights(place, "alpha_left_ddot_1")
    shutil.rmtree(place / "weights")
    shutil.rmtree(place / "state")
    real = training._step
    monkeypatch.setattr(training, "_step", lambda state, *others: 1 / 0 if state.step == 4 else real(state, *others))
    with pytest.raises(ZeroDivisionError):
        train.main(words)
    assert not (place / "weights").exists()
    monkeypatch.undo()
    train.main(words)
    again = weights(place, "alpha_left_ddot_1")
    assert all(torch.equal(again[name], value) for name, value in whole.items())


def test_a_training_that_fails_or_is_taken_does_not_stop_the_others(part, place, capfd, monkeypatch):
    train, trainings = part("train"), part("trainings")
    monkeypatch.setattr(train, "SECONDS_BETWEEN_LOOKS", 0.1)
    config = trainings.read_config(place / "config.yaml")
    config["arms"]["cortexode"].append("loss.factor=1.0e+39")  # beyond float32
    (place / "config.yaml").write_text(yaml.safe_dump(config))
    taken = trainings.wanted(config, ["alpha_left_ddot_1"])[0]
    with train.alone(taken.state(config)):
        assert train.main(["--config", str(place / "config.yaml"), "--jobs", "3"]) == 1
    names = capfd.readouterr().err.split("failed: ")[1].split(";")[0]
    assert sorted(names.split(", ")) == ["alpha_left_cortexode_0", "alpha_left_ddot_1"]
    said = (place / "state" / "alpha_left_cortexode_0" / "output.txt").read_text()
    assert "is not finite" in said
    assert "is being trained by another process" in (taken.state(config) / "output.txt").read_text()
    assert {file.stem for file in (place / "weights").glob("*.json")} == {"alpha_left_ddot_0"}


def test_a_thinned_log_keeps_means_and_validations(part):
    log = [{"step": i + 1, "loss": float(i), "learning_rate": 0.1} for i in range(12)]
    log.insert(8, {"step": 8, "validation_loss": 0.5, "cpu_seconds": 1.0})
    found = part("trainings").thinned(log, 3)
    assert [line["loss"] for line in found if "loss" in line] == [1.5, 5.5, 9.5]
    assert [line["step"] for line in found] == [4, 8, 8, 12]
    assert found[2] == log[8]
    assert part("trainings").thinned(log[:2], 3) == log[:2]
