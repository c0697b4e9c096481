"""The comparison of systems, on phantoms: trials, choice of rates, both budgets, kills, rows and tables."""

import json
import shutil
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import scipy.stats
import torch
import yaml
from safetensors.torch import load_file

from meshot.mesh.io import read_mesh, write_mesh
from meshot.metrics.distances import Surface
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights
from meshot.pipeline.training import InitialSurfaces
from meshot.provenance import read_results, write_results
from meshot.synth.cohorts import scans
from meshot.systems import Scan, get_system, read_settings, system_names
from meshot.train import engine, read_log
from meshot_book.notebook import read_meshes, read_vertex_values
from phantoms import phantom_scan, phantom_surfaces
from refusals import refuses
from scripts import scripts_in

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "comparison"
pytestmark = pytest.mark.usefixtures("one_thread")
ARMS = {
    "vox2cortex": {"title": "Vox2Cortex", "rates": [1.0e-2]},
    "corticalflow": {"title": "CorticalFlow++", "rates": [3.0e-3], "turns": 3},
    "ddot": {"title": "DDOT", "rates": [1.0e-2, 1.0e-3]},
    "classical": {"title": "classical", "rates": None},
}
SMALL_DDOT = ["network.width=4", "network.hidden=[8]", "network.n_scales=1", "training.n_faces=400"]
#: The second scan of a day: the head is moved by this much in the scanner.
SHIFT = np.array([0.6, -0.4, 0.3])


def written(place, config):
    """The configuration as a file, and the words of a command that name it."""
    (place / "config.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    return ["--config", str(place / "config.yaml")]


@pytest.fixture(scope="module")
def protocol(config):
    """The committed protocol with few systems, epochs and points."""
    arms = {name: entry | {"changes": SMALL_DDOT if name == "ddot" else []} for name, entry in ARMS.items()}
    column = {"cohorts": ["alpha"], "sides": ["left", "right"], "seeds": [0]}
    groups = {
        "steps": column | {"budget": "steps", "arms": ["ddot", "vox2cortex", "classical"]},
        "seeds": column | {"budget": "steps", "sides": ["left"], "arms": ["ddot"], "seeds": [0, 1]},
        "chain": column | {"budget": "steps", "sides": ["left"], "arms": ["corticalflow"]},
        "seconds": column | {"budget": "seconds", "arms": ["vox2cortex"]},
    }
    return config | {
        "settings": "tiny", "arms": arms, "groups": groups,
        "comparison": {
            "ours": "ddot", "rivals": ["vox2cortex", "corticalflow"], "also": ["classical"],
            "direct": [["ddot", "vox2cortex"]],
        },
        "trials": {"cohort": "alpha", "side": "left", "seed": 0, "epochs": 2, "changes": []},
        "budget": {"epochs": 2, "reference": "ddot"},
        "changes": ["training.validate_every=1", "training.save_every=1", "training.n_points=300"],
        "evaluation": config["evaluation"] | {"n_points": 500, "n_emd_points": 50, "fewest_subjects": 3},
        "consistency": {"cohort": "retest", "trained_on": "alpha", "n_points": 500},
        "pictures": {
            "cohort": "alpha", "side": "left", "n_faces": 300, "step_mm": 0.02, "chosen_by": list(ARMS),
        },
    }  # fmt: skip


def in_folder(protocol, place):
    """The protocol with all its files in one folder."""
    names = {key: str(place / key) for key in ("initial", "state", "weights")}
    return protocol | names | {
        "cohorts": {"alpha": str(place / "alpha")},
        "evaluation": protocol["evaluation"] | {"cohorts": {"alpha": str(place / "alpha")}},
        "segmentation": str(place / "segmentation.safetensors"),
        "rates": str(place / "rates.json"),
        "consistency": protocol["consistency"] | {"cohort": str(place / "retest")},
    }  # fmt: skip


def write_retest(place):
    """One subject of the cohort, scanned twice a day: the second scan is moved, and has other initial surfaces."""
    (one,) = (each for each in scans(place / "alpha") if each.name == "sub-004")
    for run in (1, 2):
        name = f"sub-001_ses-01_run-{run}"
        folders = [place / "retest" / part / "sub-001" / "ses-01" / "anat" for part in ("", "derivatives/standard")]
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
        motion = np.eye(4)
        motion[:3, 3] = SHIFT * (run - 1)
        for file in one.files():
            target = folders["space-MNI152" in file.name or "xfm" in file.name] / file.name.replace(one.name, name)
            if file.name.endswith(".surf.gii"):
                mesh = read_mesh(file)
                write_mesh(target, mesh.with_vertices(mesh.vertices - torch.from_numpy(motion[:3, 3])))
            elif file.name.endswith("xfm.json"):
                target.write_text(json.dumps({"matrix": motion.tolist()}))
            else:
                shutil.copy(file, target)
    (place / "retest" / "participants.tsv").write_text(
        "participant_id\tsplit\tkind\tseed\nsub-001\ttest\ttemplate\t3\n"
    )
    network = read_weights(place / "segmentation.safetensors", SegmentationNetwork)[0]
    surfaces = InitialSurfaces(place / "state" / "initial", network)
    for scan in scans(place / "retest"):
        for side in ("left", "right"):
            mesh = surfaces.of(one, side)
            scale = 1.0 if scan.run == "1" else 1.02
            centre = mesh.vertices.mean(dim=0)
            moved = mesh.with_vertices(centre + scale * (mesh.vertices - centre))
            write_mesh(surfaces.path(scan, side, scan.standard()), moved)


@pytest.fixture(scope="module")
def whole(phantom_place, protocol, tmp_path_factory):
    """Everything trained once, by one command, and the words that name the configuration."""
    place = tmp_path_factory.mktemp("comparison")
    shutil.copytree(phantom_place, place, dirs_exist_ok=True)
    shutil.copytree(place / "initial", place / "state" / "initial")
    write_retest(place)
    words = written(place, in_folder(protocol, place))
    torch.set_num_threads(1)
    with scripts_in(FOLDER) as load:
        assert load("train").main(words) == 0
    return place


@pytest.fixture
def place(whole, protocol, tmp_path):
    """A copy of it for one test."""
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    written(tmp_path, in_folder(protocol, tmp_path))
    return tmp_path


def words_of(place):
    return ["--config", str(place / "config.yaml")]


def test_the_protocol_is_whole(part, config):
    units = part("trials.training")
    trials, finals = units.trials(config), units.finals(config)
    names = [unit.name for unit in (*trials, *finals)]
    assert len(names) == len(set(names))
    rates = {arm: entry["rates"] for arm, entry in config["arms"].items()}
    assert rates.pop("classical") is None
    assert {len(each) for each in rates.values()} == {3}
    assert len(trials) == 3 * len(rates) == 21
    columns = {(c, s) for c in config["cohorts"] for s in ("left", "right")}
    for arm in config["arms"]:
        own = [unit for unit in finals if (unit.arm, unit.budget, unit.seed) == (arm, "steps", 0)]
        assert {(unit.cohort, side) for unit in own for side in unit.sides} == columns
        assert {unit.side == "both" for unit in own} == {arm in ("vox2cortex", "deepcsr", "classical")}
        assert {unit.side == "both" for unit in own} == {config["arms"][arm].get("both_sides", False)}
    seeds = {arm: {u.seed for u in finals if u.arm == arm and u.cohort == "oasis_like"} for arm in rates}
    assert set(map(frozenset, seeds.values())) == {frozenset({0, 1, 2})}
    seconds = {unit.arm for unit in finals if unit.budget == "seconds"}
    assert seconds == rates.keys() - {config["budget"]["reference"]}
    compared = config["comparison"]
    assert {compared["ours"], *compared["rivals"], *compared["also"]} == config["arms"].keys()
    assert {entry.get("system", arm) for arm, entry in config["arms"].items()} <= set(system_names())


def test_the_package_has_the_winning_loss_as_settings(config):
    windows, arm = get_system("windows"), config["arms"]["local"]
    combined = read_settings(windows, "combined", ["training.side=left"])
    rate = json.loads((FOLDER / "rates.json").read_text(encoding="utf-8"))["results"]["local"]["rate"]
    assert combined == read_settings(
        windows, "small", ["training.side=left", *arm["changes"], f"training.learning_rate={rate}"]
    )


def test_the_turns_are_the_networks_of_a_side(part, config):
    for arm, entry in config["arms"].items():
        kind = get_system(entry.get("system", arm))
        settings = read_settings(kind, config["settings"])
        networks = part("trials.training").limited(kind, ("left",)).parts_of(settings)
        assert entry.get("turns", 1) == len(networks)
        assert part("trials.training").has_sides(kind) == hasattr(settings.training, "side")
        both = part("trials.training").limited(kind, ("left", "right")).parts_of(settings)
        assert len(both) in (1, 2 * len(networks))


def test_two_arms_of_one_system_differ_in_their_settings(part, config):
    arms = {"near": {"system": "ddot", "rates": [1e-3], "changes": ["loss.normal_scale=2"]}, "ddot": {"rates": [1e-3]}}
    own = config | {"arms": arms}
    near, ddot = (part("trials.training").training_of("oasis_like", "left", arm, "steps", 0, own) for arm in arms)
    assert (near.name, ddot.name) == ("oasis_like_left_near_steps_0", "oasis_like_left_ddot_steps_0")
    assert near.kind().name == ddot.kind().name == "ddot"
    assert near.kept(own) != ddot.kept(own)
    assert near.settings(own, []).loss.encoding.normal_scale == 2 != ddot.settings(own, []).loss.encoding.normal_scale
    assert near.settings(own, []).training == ddot.settings(own, []).training


def test_a_side_of_a_system_of_white_and_pial_surfaces(part):
    kind = get_system("corticalflow")
    settings = kind.complete({"template": {"surfaces": ["white", "pial"]}})
    left = part("trials.training").limited(kind, ("left",))
    assert left.surfaces_of(settings) == (("left", "white"), ("left", "pial"))
    assert left.parts_of(settings) == tuple(f"left_{kind}_{k}" for kind in ("white", "pial") for k in (1, 2, 3))
    assert left.surfaces_of(kind.complete({})) == left({}).surfaces == (("left", "white"),)


def test_white_surfaces_are_measured_also_where_pial_ones_are_found(part):
    class Both(get_system("classical")):
        surfaces = tuple((side, kind) for side in ("left", "right") for kind in ("white", "pial"))
        networks: ClassVar = {}

        def find_surfaces(self, scan):
            return {key: white[key[0]].with_vertices(9 * white[key[0]].vertices) for key in self.surfaces} | {
                (side, "white"): mesh for side, mesh in white.items()
            }

    white = phantom_surfaces(0)
    scan = part("trials.scanned").Seen(phantom_scan(white, 0), {}, white, None)
    found, seconds = part("trials.scanned").reconstructed(scan, Both({}))
    assert list(found) == ["left", "right"]
    assert seconds >= 0
    for side, mesh in white.items():
        torch.testing.assert_close(found[side].vertices, mesh.vertices)


def test_both_budgets_give_steps(part, config, tmp_path):
    budgets, units = part("trials.rates"), part("trials.training")
    own = config | {"rates": str(tmp_path / "rates.json")}
    rates = {
        "ddot": {"rate": 2e-3, "seconds_per_epoch": 30.0}, "vox2cortex": {"rate": 1e-3, "seconds_per_epoch": 60.0},
        "corticalflow": {"rate": 1e-3, "seconds_per_epoch": 20.0},
    }  # fmt: skip
    unit = {
        name: units.training_of("oasis_like", "left", arm, budget, 0, own)
        for name, arm, budget in (
            ("steps", "vox2cortex", "steps"), ("seconds", "vox2cortex", "seconds"),
            ("chain", "corticalflow", "seconds"),
            ("trial", "corticalflow", "rate0.0003"), ("fixed", "classical", "steps"),
        )
    }  # fmt: skip
    with pytest.raises(
        ValueError, match="oasis_like_both_vox2cortex_steps_0 needs the rate of vox2cortex, which is not"
    ):
        budgets.changes_of(unit["steps"], own)
    write_results(tmp_path / "rates.json", rates, {}, "none", "none", 0.0)
    found = {name: budgets.changes_of(each, own) for name, each in unit.items()}
    assert found["steps"] == ["training.learning_rate=0.001", "training.n_epochs=60"]
    assert found["seconds"] == ["training.learning_rate=0.001", "training.n_epochs=30"]
    assert found["chain"] == ["training.learning_rate=0.001", "training.n_epochs=30"]
    assert found["trial"] == ["training.learning_rate=0.0003", "training.n_epochs=4"]
    assert found["fixed"] == []
    settings = unit["chain"].settings(own, found["chain"]).training
    assert (settings.n_epochs, settings.side, settings.learning_rate) == (30, "left", 1e-3)


def test_everything_is_trained_by_one_command(part, whole, capsys):
    units, config = part("trials.training"), part("trials.training").read_config(whole / "config.yaml")
    rates = read_results(whole / "rates.json")["results"]
    assert list(rates) == ["vox2cortex", "corticalflow", "ddot"]
    assert rates["ddot"]["rate"] == float(min(rates["ddot"]["assd_mm"], key=rates["ddot"]["assd_mm"].get))
    for unit in units.finals(config):
        records = unit.records(config)
        assert list(records) == list(unit.parts(config))
        for record in records.values():
            if unit.arm != "classical":
                assert record["config"]["training"]["learning_rate"] == rates[unit.arm]["rate"]
            if unit.budget == "steps" and unit.arm in ("ddot", "vox2cortex"):
                assert record["results"]["n_steps"] == 4
    before = {file: file.stat().st_mtime_ns for file in whole.rglob("*") if file.is_file()}
    assert part("train").main(words_of(whole)) == 0
    assert {file: file.stat().st_mtime_ns for file in whole.rglob("*") if file.is_file()} == before
    assert part("train").main([*words_of(whole), "--list"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == len(units.trials(config)) + len(units.finals(config))
    assert {line.split()[0] for line in said} == {"there"}


def test_systems_that_choose_their_rates_at_the_same_time_do_not_lose_any(part, place, monkeypatch):
    budgets, config = part("trials.rates"), part("trials.training").read_config(place / "config.yaml")
    (place / "rates.json").unlink()
    read = budgets.known_rates

    def slow(config):
        known = read(config)
        time.sleep(0.2)
        return known

    monkeypatch.setattr(budgets, "known_rates", slow)
    arms = ["vox2cortex", "corticalflow", "ddot"]
    with ThreadPoolExecutor(len(arms)) as pool:
        list(pool.map(lambda arm: budgets.choose(config, arm), arms))
    assert list(read(config)) == arms


def test_rates_of_another_protocol_are_refused(part, place, capsys):
    budgets, train, units = part("trials.rates"), part("train"), part("trials.training")
    config = units.read_config(place / "config.yaml")
    assert budgets.choose(config, "ddot") == budgets.known_rates(config)
    ddot = config["arms"]["ddot"]
    others = {
        "chosen from 0.01, 0.001; the protocol has 1e-05, 0.001: remove ddot from ":
            {"arms": config["arms"] | {"ddot": ddot | {"rates": [1e-5, 1e-3]}}},
        "other settings; the protocol asks for .*n_epochs=999 ": {"trials": config["trials"] | {"epochs": 999}},
        "other settings; the protocol asks for .*width=5 ":
            {"arms": config["arms"] | {"ddot": ddot | {"changes": [*SMALL_DDOT, "network.width=5"]}}},
        "other settings; the protocol asks for .*seed=3: ": {"trials": config["trials"] | {"seed": 3}},
    }  # fmt: skip
    unit = units.training_of("alpha", "left", "ddot", "steps", 0, config)
    for message, change in others.items():
        for ask in (lambda own: budgets.choose(own, "ddot"), lambda own: budgets.changes_of(unit, own)):
            refuses(f"the rate of ddot was .*{message}", ask, config | change)
    words = written(place, config | {"trials": config["trials"] | {"epochs": 3}})
    assert train.main([*words, "--only", unit.name]) == 1
    said = capsys.readouterr().err
    assert "remove ddot from " in said
    assert f"waiting for trials of rates: {unit.name}" in said


def test_the_committed_rates_are_those_of_the_protocol(part, config, root):
    budgets = part("trials.rates")
    known = read_results(root / config["rates"])["results"]
    assert known.keys() == {arm for arm, entry in config["arms"].items() if entry["rates"]}
    for arm, entry in known.items():
        budgets.require_rate_of_protocol(arm, entry, config)


def test_weights_that_are_only_measured_take_half_the_space(part, whole):
    units, config = part("trials.training"), part("trials.training").read_config(whole / "config.yaml")
    those = [unit for unit in [*units.trials(config), *units.finals(config)] if unit.arm == "ddot"]
    for unit in those:
        for name in unit.parts(config):
            kept, state = (folder / f"{name}.safetensors" for folder in (unit.kept(config), unit.state(config)))
            whole_weights = unit.is_trial or (unit.budget, unit.seed) == ("steps", 0)
            found, made = load_file(kept), load_file(state)
            for key, value in made.items():
                assert torch.equal(found[key], value if whole_weights else value.half())
    assert {(unit.budget, unit.seed) for unit in those if not unit.is_trial} > {("steps", 0)}


def test_the_score_is_the_distance_of_what_is_reconstructed(part, whole):
    units, budgets = part("trials.training"), part("trials.rates")
    config = units.read_config(whole / "config.yaml")
    unit = units.trials(config)[0]
    assert unit.arm == "vox2cortex"
    system = get_system("vox2cortex").load(unit.kept(config))
    (subject,) = scans(whole / "alpha", "validation")
    found = Surface(system.reconstruct(Scan(subject.standard().volume))["left", "white"])
    truth = Surface(subject.surface("white", "left", "standard"))
    both = (
        np.abs(a.offsets(b.sample(500, seed)).distances).mean()
        for seed, (a, b) in enumerate([(found, truth), (truth, found)])
    )
    score = units.read_json(unit.kept(config) / budgets.SCORE)
    assert score["assd_mm"] == pytest.approx(np.mean(list(both)), rel=0.2)
    (record,) = unit.records(config).values()
    assert score["seconds_per_epoch"] == budgets.seconds_of_epoch(record)


def test_an_arm_can_choose_its_rate_by_its_own_loss(part, place):
    units, budgets = part("trials.training"), part("trials.rates")
    config = units.read_config(place / "config.yaml")
    config["arms"]["ddot"]["chosen_by"] = "loss"
    (place / "rates.json").unlink()
    own = [trial for trial in units.trials(config) if trial.arm == "ddot"]
    found = budgets.score_of(own[0].kept(config), own[0], config)
    (part_name,) = own[0].parts(config)
    lines = read_log(own[0].kept(config) / f"{part_name}.log.jsonl")
    steps = [(line["step"], line["loss"]) for line in lines if "loss" in line]
    assert found["loss"] == np.mean([loss for step, loss in steps if step >= 0.9 * max(steps)[0]])
    for number, trial in enumerate(own):  # the nearest has the largest loss
        score = units.read_json(trial.kept(config) / budgets.SCORE) | {"assd_mm": 1.0 + number, "loss": 9.0 - number}
        (trial.kept(config) / budgets.SCORE).write_text(json.dumps(score))
    assert budgets.choose(config, "ddot")["ddot"]["rate"] == own[-1].rate
    del config["arms"]["ddot"]["chosen_by"]
    (place / "rates.json").unlink()
    assert budgets.choose(config, "ddot")["ddot"]["rate"] == own[0].rate


def test_the_seconds_of_an_epoch_leave_out_what_comes_before_the_first_validation(part):
    validations = [{"step": step, "cpu_seconds": 100.0 + 2 * step} for step in (6, 12, 18)]
    results = {"validations": validations, "n_steps": 18, "cpu_seconds": 140.0}
    record = {"results": results, "config": {"training": {"n_epochs": 6}}}
    assert part("trials.rates").seconds_of_epoch(record) == pytest.approx(6.0)
    assert part("trials.rates").seconds_of_epoch(record | {"results": results | {"validations": validations[-1:]}}) == (
        pytest.approx(140 / 6)
    )


def test_a_killed_training_ends_with_the_same_weights(part, place, monkeypatch):
    train, units = part("train"), part("trials.training")
    config = units.read_config(place / "config.yaml")
    (unit,) = (each for each in units.finals(config) if each.name == "alpha_left_corticalflow_steps_0")
    whole = {name: p.network.state_dict() for name, p in units.trained_system(unit, unit.kept(config)).parts.items()}
    for folder in (unit.kept(config), unit.state(config)):
        shutil.rmtree(folder)
    real, steps = engine._step, []

    def step(state, *others):
        steps.append(state.step)
        if len(steps) == 4:
            raise KeyboardInterrupt
        return real(state, *others)

    monkeypatch.setattr(engine, "_step", step)
    words = [*words_of(place), "--only", unit.name]
    with pytest.raises(KeyboardInterrupt):
        train.main(words)
    assert not unit.is_made(config)
    assert train.main(words) == 0
    assert steps == [0, 1, 0, 1, 1, 0, 1]
    for name, p in units.trained_system(unit, unit.kept(config)).parts.items():
        assert all(torch.equal(value, whole[name][key]) for key, value in p.network.state_dict().items())


def test_a_run_stops_after_some_minutes_and_goes_on(part, place):
    name = "alpha_both_classical_steps_0"
    for folder in ("weights", "state"):
        shutil.rmtree(place / folder / name)
    words = [*words_of(place), "--only", name]
    with pytest.raises(SystemExit) as stop:
        part("train").main([*words, "--minutes", "1e-5"])
    assert stop.value.code == 75
    assert not (place / "weights" / name).exists()
    assert part("train").main([*words, "--minutes", "5"]) == 0
    assert (place / "weights" / name).is_dir()
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_trial_without_a_finite_loss_has_no_score(part, place, capsys):
    train, units = part("train"), part("trials.training")
    config = units.read_config(place / "config.yaml")
    config["arms"] = {"cortexode": {"rates": [1.0e-2], "changes": [*SMALL_DDOT, "loss.factor=1.0e+39"]}}
    config["groups"] = {"steps": config["groups"]["steps"] | {"arms": ["cortexode"]}}
    config |= {"state": str(place / "other"), "weights": str(place / "none"), "rates": str(place / "other.json")}
    words = written(place, config)
    assert train.main([*words, "--only", "*rate*"]) == 1
    said = capsys.readouterr().err
    assert "cortexode: no rate has a score; give it other rates in the protocol" in said
    assert "failed: cortexode" in said
    (unit,) = units.trials(config)
    score = units.read_json(unit.kept(config) / "score.json")
    assert score["assd_mm"] is None
    assert "is not finite" in score["why"]
    config["arms"]["cortexode"]["changes"].append("network.width=5")
    with pytest.raises(ValueError, match=r"cortexode_rate0.01_0 was made with other settings; .*width=5 "):
        part("trials.rates").choose(config, "cortexode")
    assert train.main([*words, "--only", "alpha_left_cortexode_steps_0"]) == 1
    assert "waiting for trials of rates: alpha_left_cortexode_steps_0" in capsys.readouterr().err
    with pytest.raises(ValueError, match="no training is called nobody; there are alpha_left_cortexode_rate"):
        train.main([*words, "--only", "nobody"])


def test_a_training_does_not_fail_because_of_the_trials_of_another_system(part, place, monkeypatch):
    train, asked, trials = part("train"), [], part("trials.train")
    real = trials.choose

    def choose(config, arm):
        asked.append(arm)
        if arm == "corticalflow":
            raise ValueError("corticalflow: no rate has a score")
        return real(config, arm)

    monkeypatch.setattr(trials, "choose", choose)
    assert train.main([*words_of(place), "--only", "*_ddot_steps_0"]) == 0
    assert asked == ["ddot"]
    assert train.main([*words_of(place), "--only", "*_vox2cortex_seconds_0"]) == 0
    assert asked[1:] == ["vox2cortex", "ddot"]
    assert train.main([*words_of(place), "--only", "*_corticalflow_*"]) == 1


@pytest.fixture(scope="module")
def results(whole):
    """What is measured of it, by one command."""
    torch.set_num_threads(1)
    with scripts_in(FOLDER) as load:
        load("run").peak_of = lambda unit, subject, config_file: float(len(unit.name))
        load("run").main([*words_of(whole), "-o", str(whole / "out" / "results.json")])
    return read_results(whole / "out" / "results.json")["results"]


def test_every_system_is_measured_on_every_held_out_subject(part, whole, results):
    assert results["missing"] == []
    assert results["too_few_subjects"] == {"alpha": 2}
    rows = part("trials.rows").read_rows(whole / "out" / "subjects.csv")
    assert len(rows) == 3 * (2 * 2 + 2 * 4 + 2)  # two sides: initial, perfect, ddot, vox2cortex twice, classical; left
    assert {(row["arm"], row["side"]) for row in rows if row["arm"] == "corticalflow"} == {("corticalflow", "left")}
    by_arm = {row["arm"]: row for row in rows if (row["subject"], row["side"]) == ("sub-004", "left")}
    assert 0.2 < by_arm["initial"]["assd_mm"] < 1.5
    assert by_arm["perfect"]["assd_mm"] < 1e-9 < by_arm["perfect"]["swd_mm"] < by_arm["perfect"]["emd_mm"]
    assert by_arm["classical"]["assd_mm"] < 0.6
    assert by_arm["classical"]["cpu_seconds"] > 0
    line = next(x for x in results["table_1"] if (x["arm"], x["side"], x["kind"]) == ("initial", "right", "template"))
    own = [r["assd_mm"] for r in rows if (r["arm"], r["side"], r["kind"]) == ("initial", "right", "template")]
    assert (line["n_subjects"], line["assd_mm"]["mean"]) == (2, pytest.approx(np.mean(own), rel=1e-5))
    assert results["peak_mb"].keys() == ARMS.keys()


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="peaks are read in /proc")
def test_memory_is_measured_in_a_process_of_its_own(part, whole, monkeypatch):
    memory, units = part("memory"), part("trials.training")
    config = units.read_config(whole / "config.yaml")
    (unit,) = (each for each in units.finals(config) if each.arm == "classical")
    assert 0 <= memory.peak_of(unit, "sub-004", whole / "config.yaml") < 2000
    monkeypatch.setattr(memory, "__file__", str(whole / "absent.py"))
    with pytest.raises(RuntimeError, match=r"the memory of .*classical_steps_0 was not measured: .*No such file"):
        memory.peak_of(unit, "sub-004", whole / "config.yaml")


def test_pairs_are_aligned_before_they_are_compared(part, whole, results):
    rows = part("trials.rows").read_rows(whole / "out" / "pairs.csv")
    perfect, initial = ([r for r in rows if r["arm"] == arm] for arm in ("perfect", "initial"))
    assert [row["side"] for row in perfect] == ["left", "right"]
    for row in perfect:
        assert row["icp_residue_mm"] < 1e-3
        assert row["rigid_residue_mm"] < 0.05 < np.linalg.norm(SHIFT)
    assert all(row["assd_mm"] > 0.03 for row in initial)  # the second was enlarged by two per cent
    assert {line["arm"]: line["n_pairs"] for line in results["table_2"]} == {
        "initial": 1, "perfect": 1, "ddot": 1, "vox2cortex": 1, "classical": 1, "corticalflow": 0,
    }  # fmt: skip


def test_tables_follow_from_the_rows_and_state_only_settings_with_which_they_were_measured(part, tmp_path):
    tables, config = part("tables"), part("trials.training").read_config(FOLDER / "config.yaml")
    output, words = tmp_path / "results.json", written(tmp_path, config)
    for name in ("results.json", "subjects.csv", "pairs.csv"):
        shutil.copy(FOLDER / name, tmp_path / name)
    before = output.read_bytes()
    assert tables.main([*words, "-o", str(output)]) == 0
    assert output.read_bytes() == before
    own = config["evaluation"]
    written(tmp_path, config | {"evaluation": own | {"n_points": 1 + own["n_points"]}, "later": 1})
    with pytest.raises(ValueError, match="were measured with other settings in evaluation, later; tables can be made"):
        tables.main([*words, "-o", str(output)])
    assert output.read_bytes() == before
    written(tmp_path, config | {"comparison": config["comparison"] | {"direct": []}})
    assert tables.main([*words, "-o", str(output)]) == 0
    assert read_results(output)["config"]["comparison"]["direct"] == []
    with (tmp_path / "pairs.csv").open("a") as file:
        file.write("\n")
    refuses("the rows beside .* are not those that were measured with it", tables.main, [*words, "-o", str(output)])


def test_the_pictured_surfaces_are_those_of_the_median_and_the_worst_subject(part, whole, results):
    rows = part("trials.rows").read_rows(whole / "out" / "subjects.csv")
    means = {}
    for each in rows:
        if (each["side"], each["kind"], each["budget"], each["seed"]) == ("left", "template", "steps", 0):
            means.setdefault(each["subject"], []).append(each["assd_mm"])
    first, second = sorted(means, key=lambda subject: np.mean(means[subject]))
    words = [*words_of(whole), "-o", str(whole / "out" / "p.gz"), "--rows", str(whole / "out" / "subjects.csv")]
    assert part("pictures").main(words) == 0
    meshes, distances = read_meshes(whole / "out" / "p.gz"), read_vertex_values(whole / "out" / "p.gz")
    names = ["initial", "ddot", "vox2cortex", "classical", "corticalflow", "true"]
    assert list(meshes) == [f"median/{first}/{name}" for name in names] + [f"worst/{second}/{name}" for name in names]
    for name, mesh in meshes.items():
        assert len(mesh.faces) <= 300
        assert distances[name].shape == (len(mesh.vertices),)
        assert (distances[name].max() < 1e-3) == name.endswith("true")
    by_arm = {r["arm"]: r["assd_mm"] for r in rows if (r["subject"], r["side"], r["seed"]) == (first, "left", 0)}
    close = float(distances[f"median/{first}/classical"].mean())
    assert close == pytest.approx(by_arm["classical"], rel=0.5)


def test_the_median_is_one_of_the_subjects(part):
    place = {"cohort": "a", "side": "left", "chosen_by": ["ddot", "deepcsr"]}
    chosen_subjects = part("pictures").chosen_subjects
    rows = [row(arm, f"s{i}", i / 10) for i in (3, 1, 2, 5, 4) for arm in ("ddot", "deepcsr")]
    rows += [row("ddot", "s6", 9.0, "seconds"), row("ddot", "s7", 9.0, seed=1), row("ddot", "s8", 9.0, kind="other")]
    rows += [row("later", "s1", 99.0), row("later", "s9", 99.0)]  # does not contribute
    assert chosen_subjects(rows, place) == {"median": "s3", "worst": "s5"}
    with pytest.raises(ValueError, match=r"no system is measured on the right side of a: run run\.py first"):
        chosen_subjects(rows, place | {"side": "right"})


def test_what_is_missing_is_named_and_measured_later(part, place, capsys, monkeypatch):
    run, output = part("run"), ["-o", str(place / "out" / "results.json")]
    (place / "weights" / "alpha_left_ddot_steps_1").rename(place / "aside")
    calls = []
    monkeypatch.setattr(run, "rows_of", lambda task, *a: calls.append(task["of"]) or [])
    monkeypatch.setattr(run, "lines_of", lambda *a: ([], [], {}))
    run.main([*words_of(place), *output])
    assert "missing (train.py makes them): ['alpha_left_ddot_steps_1']" in capsys.readouterr().err
    assert read_results(place / "out" / "results.json")["results"]["missing"] == ["alpha_left_ddot_steps_1"]
    assert calls.count("alpha_left_ddot_steps_0") == 3 + 1 + 1  # subjects, pair, memory
    (place / "aside").rename(place / "weights" / "alpha_left_ddot_steps_1")
    calls.clear()
    run.main([*words_of(place), *output])
    assert calls == ["alpha_left_ddot_steps_1"] * 3
    assert not (place / "out" / "partial.jsonl").exists()
    shutil.rmtree(place / "weights")
    with pytest.raises(ValueError, match=r"no trained system is in .*: run experiments/comparison/train.py first"):
        run.main([*words_of(place), *output])


@pytest.mark.filterwarnings("ignore:.*that another configuration or other code has done")
def test_a_system_that_joins_later_leaves_measured_rows_as_they_are(part, place, monkeypatch):
    run, output = part("run"), ["-o", str(place / "out" / "results.json")]
    config = yaml.safe_load((place / "config.yaml").read_text(encoding="utf-8"))
    (place / "weights" / "alpha_left_ddot_steps_1").rename(place / "aside")  # finished rows are kept
    calls = []
    monkeypatch.setattr(run, "rows_of", lambda task, *a: calls.append(task["of"]) or [])
    monkeypatch.setattr(run, "lines_of", lambda *a: ([], [], {}))
    run.main([*words_of(place), *output])
    first = list(calls)
    later = {"windows_many": config["arms"]["ddot"] | {"title": "many windows", "system": "ddot"}}
    written(place, config | {"arms": config["arms"] | later})
    run.main([*words_of(place), *output])
    assert calls == first
    own = config["evaluation"] | {"n_points": 1 + config["evaluation"]["n_points"]}
    written(place, config | {"evaluation": own})
    run.main([*words_of(place), *output])
    assert calls == first + first
    monkeypatch.setattr(run, "setting", lambda config: SimpleNamespace(segmentation=None))
    digests = iter(("one", "other"))
    monkeypatch.setattr(run, "network_digest", lambda network: next(digests))
    assert run.depends(config) != run.depends(config)


def test_trainings_of_another_protocol_are_refused(part, place):
    run, words = part("run"), words_of(place)
    config = yaml.safe_load((place / "config.yaml").read_text(encoding="utf-8"))
    written(place, config | {"budget": {"epochs": 3, "reference": "ddot"}})
    with pytest.raises(ValueError, match=r"_ddot_steps_0/left_white\.json was trained with other settings than the "):
        run.main([*words, "-o", str(place / "out" / "results.json")])


def row(arm, subject, assd, budget="steps", seed=0, side="left", crossing=0, **more):
    numbers = {"emd_mm": 2 * assd, "swd_mm": assd, "assd_mm": assd, "hausdorff90_mm": 2 * assd, "normals": 1 - assd}
    about = {"cohort": "a", "side": side, "subject": subject, "kind": "template", "arm": arm, "budget": budget}
    counts = {"crossing_faces": crossing, "crossing_percent": crossing / 10, "euler_number": 2, "cpu_seconds": 1.0}
    return about | {"seed": seed, "failed": None} | numbers | counts | more


def test_who_is_better_follows_from_the_interval(part, config):
    tables, noise = part("tables"), [0.01, -0.01, 0.02, 0.0]
    rows = [row("ddot", f"s{i}", 0.2, crossing=2 * (i == 0)) for i in range(4)]
    rows += [row("cortexode", f"s{i}", 0.3 + x) for i, x in enumerate(noise)]
    rows += [row("deepcsr", f"s{i}", 0.2 + x - 0.005) for i, x in enumerate(noise)]
    rows += [row("vox2cortex", f"s{i}", 0.1 + x, "seconds") for i, x in enumerate(noise)]
    rows += [row("initial", f"s{i}", 0.5, None, None) for i in range(4)]
    rows += [row("ddot", "s9", 9.0, failed="no surface", assd_mm=None), row("ddot", "s8", 9.0, kind="procedural")]
    found = tables.tables(rows, [], config)
    gaps = {(gap["second"], gap["budget"]): gap for gap in found["differences"]}
    assert gaps["cortexode", "steps"]["assd_mm"]["gap"] == pytest.approx(-0.105)
    assert gaps["cortexode", "steps"]["n_shared"] == 4
    assert [gaps[key]["assd_mm"]["better"] for key in gaps] == ["ours", "undecided", "other", "ours"]
    assert gaps["cortexode", "steps"]["normals"]["better"] == "ours"
    best = {(x["budget"], x["metric"]): x for x in found["claims"]["best"]}
    assert best["steps", "assd_mm"] == {
        "cohort": "a", "side": "left", "budget": "steps", "metric": "assd_mm", "ours": ["cortexode"], "other": [],
        "undecided": ["deepcsr"], "missing": ["vox2cortex", "corticalflow"],
    }  # fmt: skip
    assert best["seconds", "emd_mm"]["other"] == ["vox2cortex"]
    assert found["claims"]["against_initial"] == [{"cohort": "a", "side": "left", "assd_mm": "ours"}]
    untouched = {x["metric"]: x for x in found["claims"]["best_of_initial"]}  # by the same rule as DDOT
    assert (untouched["assd_mm"]["ours"], untouched["assd_mm"]["other"]) == ([], ["deepcsr", "cortexode"])
    (crossing,) = found["claims"]["crossing"]
    assert (crossing["n_subjects"], crossing["n_subjects_crossing"], crossing["mean_percent"]) == (4, 1, 0.05)
    line = next(x for x in found["table_1"] if (x["arm"], x["kind"]) == ("ddot", "template"))
    assert (line["n_subjects"], line["n_failed"], line["assd_mm"]["mean"]) == (4, 1, pytest.approx(0.2))


def test_two_systems_are_compared_for_every_budget_and_seed(part):
    noise = [0.01, -0.01, 0.02, 0.0]
    rows = [
        row(arm, f"s{i}", value + x * (arm == "windows"), budget, seed)
        for arm, value in (("windows", 0.2), ("cortexode", 0.3), ("ddot", 0.4))
        for budget, seed in (("steps", 0), ("steps", 1), ("seconds", 0))
        for i, x in enumerate(noise)
        if (arm, seed) != ("ddot", 1)
    ]
    rows += [row(arm, "s9", 9.0, kind="procedural", seed=1) for arm in ("windows", "cortexode")]
    rows.append(row("initial", "s0", 0.5, None, None))
    rows.append(row("windows", "s8", 9.0, failed="no surface", assd_mm=None))
    found = part("tables").direct(rows, [["windows", "cortexode"], ["ddot", "windows"], ["absent", "windows"]])
    places = [(gap["first"], gap["second"], gap["budget"], gap["seed"]) for gap in found]
    first, other = ("windows", "cortexode"), ("ddot", "windows")
    own = [(*first, *each) for each in (("seconds", 0), ("steps", 0), ("steps", 1))]
    assert sorted(places) == sorted([*own, (*other, "seconds", 0), (*other, "steps", 0)])
    gap = found[places.index((*first, "steps", 1))]
    gaps = np.array(noise) - 0.1
    half = scipy.stats.t.ppf(0.975, 3) * gaps.std(ddof=1) / 2
    assert gap["assd_mm"] == {
        "gap": pytest.approx(gaps.mean()), "low": pytest.approx(gaps.mean() - half),
        "high": pytest.approx(gaps.mean() + half), "better": "ours",
    }  # fmt: skip
    assert gap["normals"]["better"] == "ours"
    assert (gap["n_shared"], gap["cohort"], gap["side"]) == (4, "a", "left")


def test_a_surface_that_is_not_found_is_counted(part, phantom_place):
    measuring, scanned = part("measuring"), part("trials.scanned")

    class Blind:
        needs = ()

        def reconstruct(self, scan):
            raise ValueError(f"no inside among {scan.image.data.size} voxels")

    subject = scans(phantom_place / "alpha", "test")[0]
    network = read_weights(phantom_place / "segmentation.safetensors", SegmentationNetwork)[0]
    scan = scanned.seen(subject, InitialSurfaces(phantom_place / "initial", network))
    assert scan.seconds is None  # the initial surfaces were there
    found = scanned.reconstructed(scan, Blind())
    why = f"no inside among {scan.scan.volume.data.size} voxels"
    assert measuring.subject_rows(scan, found, ("left",), {}) == [{"side": "left", "failed": why}]
    rows = measuring.pair_rows((scan, scan), lambda each: scanned.reconstructed(each, Blind()), ("right",), {})
    assert rows == [{"side": "right", "failed": why}]


def test_the_seconds_of_an_initial_surface_are_kept_beside_it(part, phantom_place, tmp_path, monkeypatch):
    scanned = part("trials.scanned")
    subject = scans(phantom_place / "alpha", "test")[0]
    network = read_weights(phantom_place / "segmentation.safetensors", SegmentationNetwork)[0]
    surfaces, stored = (InitialSurfaces(folder, network) for folder in (tmp_path, phantom_place / "initial"))

    def computed(self, subject, side):
        mesh = read_mesh(stored.path(subject, side, subject.standard()))
        write_mesh(self.path(subject, side, subject.standard()), mesh)
        return mesh

    with monkeypatch.context() as patch:
        patch.setattr(InitialSurfaces, "of", computed)
        first = scanned.seen(subject, surfaces).seconds
    assert first > 0
    assert scanned.seen(subject, surfaces).seconds == first
    (file,) = tmp_path.rglob("*.seconds")
    file.unlink()
    assert scanned.seen(subject, surfaces).seconds is None


def test_rows_are_read_as_they_were_written(part, tmp_path):
    rows = part("trials.rows")
    given = [
        {"subject": "007", "side": "left", "n": 3, "x": 0.1, "failed": None},
        {"subject": "8", "x": -2.5, "y": 1e-7},
    ]
    rows.write_rows(tmp_path / "a.csv", given)
    names = ("subject", "side", "n", "x", "failed", "y")
    assert rows.read_rows(tmp_path / "a.csv") == [{name: each.get(name) for name in names} for each in given]
    rows.write_rows(tmp_path / "none.csv", [])
    assert rows.read_rows(tmp_path / "none.csv") == []
    (tmp_path / "bad.csv").write_text("x\nhalf\n")
    refuses(r"bad.csv is damaged \(could not convert", rows.read_rows, tmp_path / "bad.csv")
    for lines, n in (("1,a,2,3", 4), ("1,a", 2), ("1", 1)):
        (tmp_path / "bad.csv").write_text(f"x,subject,y\n1,b,2\n{lines}\n")
        with pytest.raises(ValueError, match=rf"damaged \(a line has {n} columns, and the first line 3: {lines}\)"):
            rows.read_rows(tmp_path / "bad.csv")
    refuses("does not exist; measure the trained systems", rows.read_rows, tmp_path / "absent.csv")


def test_systems_are_compared_only_if_they_learned_from_the_same_data(part):
    kinds = {"ddot": ("left white",), "cortexode": ("left white",), "deepcsr": ()}
    column, require = part("run").column_of, part("trials.training").require_fair

    def training(name, data, processor="A"):
        each = SimpleNamespace(cohort="x", side="left", kind=lambda: SimpleNamespace(needs=kinds[name]))
        return name, column(each, processor), data

    require([training("ddot", 1), training("cortexode", 1), training("deepcsr", 2)])
    # Initial surfaces, which DeepCSR does not need, differ in rounding between processors.
    require([training("ddot", 1), training("cortexode", 3, "B"), training("deepcsr", 2, "B")])
    for other in (training("cortexode", 3), training("ddot", 3)):
        refuses("learned from other data than ddot", require, [training("ddot", 1), other])
    with pytest.raises(ValueError, match="deepcsr learned from other data than deepcsr"):
        require([training("deepcsr", 2), training("deepcsr", 3, "B")])
