"""Every experiment goes on where it was stopped: killed after its first task, with work that is cheap."""

import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import yaml

from meshot.provenance import read_results
from scripts import scripts_in

EXPERIMENTS = Path(__file__).resolve().parents[2] / "experiments"
#: Without tasks: what the benchmarks find, and tables that are read in seconds.
WITHOUT_TASKS = {"cost", "paper_table"}
PERSON = SimpleNamespace(participant_id="sub-001", kind="template")


def scans_of(cohort, *arguments):
    """Two scans, whatever is on disk."""
    standard = SimpleNamespace(volume=None)
    return [
        SimpleNamespace(name=f"{cohort} {k}", participant=PERSON, session=k, run="1", standard=lambda: standard)
        for k in ("1", "2")
    ]


class Work:
    """Stands for what an experiment computes; a kill comes in the midst of call number ``killed_at``."""

    def __init__(self):
        self.calls, self.killed_at = [], None

    def of(self, found, name="", told_by=lambda *arguments: arguments):
        """A function that finds this (or what this function finds), and is noted with what tells its calls apart."""

        def work(*arguments):
            self.calls.append((name, *map(repr, told_by(*arguments))))
            if len(self.calls) == self.killed_at:
                raise KeyboardInterrupt
            return found(*arguments) if callable(found) else found

        return work

    def killed(self, call, at=2):
        self.calls, self.killed_at = [], at
        with pytest.raises(KeyboardInterrupt):
            call()
        return self.calls

    def whole(self, call):
        self.calls, self.killed_at = [], None
        call()
        return self.calls


def quiet(run, *names, found=None):
    """What comes after the tasks is not looked at here."""
    for name in names:
        assert callable(getattr(run, name))
        setattr(run, name, lambda *a, **k: {} if found is None else found)


def replace(run, **values):
    for name, value in values.items():
        assert hasattr(run, name)
        setattr(run, name, value)


def first_two(*arguments):
    return arguments[:2]


def axioms(run, work):
    replace(run, search=work.of({}))
    quiet(run, "measured", "followed")


def beyond_random(run, work):
    replace(run, estimates=work.of({}))
    quiet(run, "summarise")


def blur(run, work):
    replace(run, run_once=work.of({}))
    quiet(run, "summarise", "limit_rows", "yardsticks")


def circle_to_polygon(run, work):
    replace(run, run_once=work.of({}))
    quiet(run, "summarise", "floors")


def cohorts(run, work):
    replace(run, summary_of=work.of({}), scans=scans_of)
    quiet(run, "cpu_seconds")
    for name in ("oasis_like", "adni_like", "test_retest"):
        (run.HERE / name).mkdir(exist_ok=True)
    return ["--cohorts", str(run.HERE)]


def comparison(run, work):
    tasks = [{"what": "subject", "of": name, "data": "digest"} for name in ("initial", "oasis_like_left_ddot_steps_0")]
    replace(
        run, rows_of=work.of([], told_by=lambda task, *a: (task["of"],)), tasks_of=lambda *a: tasks,
        setting_of=lambda config, *a: SimpleNamespace(config=config, segmentation=None, pairs={}, subjects={}),
        lines_of=lambda *a: ([], [], {}),
        described=lambda *a: {}, require_fair=lambda *a: None, too_few=lambda *a: {},
    )  # fmt: skip
    quiet(run, "network_digest", "provenance", found={"commit": "a"})
    planned = run.finals(run.read_config())[:2]
    run.finals = lambda config: planned
    for each in planned:
        object.__setattr__(each, "is_made", lambda config: True)


def convergence(run, work):
    runs = [{"part": "sizes", "n": n} for n in range(3)]
    replace(run, PARTS={"sizes": (lambda config: runs, work.of([]), lambda rows, config: {"n": len(rows)})})


def ddot(run, work):
    replace(
        run, initial_row=work.of({}), flow_row=work.of({}), read_weights=lambda path, *a: [path],
        InitialSurfaces=lambda *a: 0, seen=lambda subject, *a: subject.name,
        scans=scans_of, described=lambda each, *a: {"cohort": each.cohort, "side": each.side, "data": {}},
        digests_of=lambda there, *a: dict.fromkeys([run.INITIAL, *(each.name for each in there)], "digest"),
        data_digests=lambda subjects: {cohort: dict.fromkeys(those, "digest") for cohort, those in subjects.items()},
    )  # fmt: skip
    quiet(run, "segmentation_network", "network_digest", "summarised", "provenance", found={"commit": "a"})
    planned = run.wanted(run.read_config())[:2]
    run.wanted = lambda config: planned
    for each in planned:
        object.__setattr__(each, "is_made", lambda config: True)


def correspondence(run, work):
    replace(run, score=work.of({}), participants=lambda *a: [PERSON])
    quiet(run, "means")
    replace(run, yaml=SimpleNamespace(safe_load=lambda text: yaml.safe_load(text) | {"sides": ["left", "right"]}))
    return ["--cohorts", str(run.HERE)]


def deforming(run, work):
    replace(run, work=work.of({}))
    quiet(run, "collect", found={"fits": []})
    quiet(run, "write_meshes")


def directions(run, work):
    replace(run, mean_over_all=work.of((1.0, 0.0)), relative_errors=work.of(np.zeros((2, 2))))
    quiet(run, "summarise")


def encoding_rates(run, work):
    replace(run, MEASURE={"levels": work.of({}), "clock": work.of({})})
    quiet(run, "summarise", "summarise_clock")


def parts(run, work):
    replace(run, PARTS={name: work.of({}, name) for name in run.PARTS})


def fixed_supports(run, work):
    replace(run, fit_once=work.of({}))
    quiet(run, "summarise", "differences", "cost_rows")


def floors(run, work):
    replace(run, measured=work.of(1.0))
    quiet(run, "summarise")


def fsaverage5_flow(run, work):
    replace(run, do_task=work.of({"fits": [{"seconds": 1.0}]}, told_by=first_two))


def ground_cost(run, work):
    replace(run, row_of=work.of({}))
    quiet(run, "summarise", "sliced_rows", "asked_rows")


def grid_floor(run, work):
    scan = SimpleNamespace(**vars(scans_of("a")[0]), surface=lambda kind, side: side)
    replace(run, measured=work.of({}, told_by=first_two), scans=lambda *a: [scan])
    quiet(run, "summary", "exponent")


def mni152(run, work):
    def found(side, part, config, place):
        (place / run.VELOCITY.format(side)).touch()
        return {"fit": []}

    replace(run, do_part=work.of(found, told_by=first_two))


def normal_scale(run, work):
    replace(run, pairs=lambda config: {"a": (1, 2), "b": (3, 4)}, measure_pair=work.of({"rows": []}))
    quiet(run, "crossing_scale")


def one_subject(run, work):
    found = {"surface": {"cpu_seconds": 1.0}, "curve": []}
    example = SimpleNamespace(initial=None), {"name": "sub-001", "side": "left"}
    replace(run, train_arm=work.of(found), read_example=lambda path: example)
    quiet(run, "measured")


def people(run, work):
    replace(run, measured=work.of({}, told_by=lambda scan, networks, config: (scan.name, networks)), scans=scans_of)
    replace(run, load_networks=lambda **chosen: str(chosen))
    quiet(run, "digests", "summarised", "measured_average")


def person(run, work):
    replace(run, measured=work.of({}, told_by=lambda *arguments: ()), compared=work.of({}, told_by=first_two))
    replace(run, load_networks=lambda **chosen: None, inputs_of=lambda *arguments: {"files": {}})
    return ["scan", "grey", "white", "--robustness"]


def segmentation(run, work):
    replace(
        run,
        measured=work.of({}, told_by=lambda scan, side, *a: (scan.name, side)),
        scans=scans_of,
        read_weights=lambda *a: (None, None),
    )
    quiet(run, "segment", "summary", "described")
    quiet(run, "network_digest", found="digest")


def self_intersection(run, work):
    replace(run, WORK={name: work.of({}, name) for name in run.WORK})
    quiet(run, "differences")


def study(run, work):
    replace(run, visited=work.of({}, told_by=lambda task, config: tuple(task.values())))
    quiet(run, "tables")


def template_baseline(run, work):
    replace(run, score=work.of({}), participants=lambda *a: [PERSON])
    quiet(run, "summarise")
    return ["--cohorts", str(run.HERE)]


def transport_rates(run, work):
    replace(run, errors=work.of({}))
    quiet(run, "chamfer_limit", "summarise")


def weights_and_areas(run, work):
    replace(run, run_once=work.of({}))
    quiet(run, "summarise", "gradient_rows", "merging_errors", "forgotten_areas")


#: Experiment → how its work is made cheap; returns the words of its command line.
CHEAP = {
    function.__name__: function
    for function in (
        axioms, beyond_random, blur, circle_to_polygon, cohorts, comparison, convergence, correspondence, ddot,
        deforming, directions, encoding_rates, fixed_supports, floors, fsaverage5_flow, grid_floor, ground_cost, mni152,
        normal_scale, one_subject, people, person, segmentation, self_intersection, study, template_baseline,
        transport_rates, weights_and_areas,
    )
} | {"exact_value": parts, "sample_gradient": parts}  # fmt: skip


def test_every_experiment_is_among_them():
    assert {path.name for path in EXPERIMENTS.iterdir() if path.is_dir()} - {
        "__pycache__"
    } == CHEAP.keys() | WITHOUT_TASKS


@pytest.fixture
def torch_as_it_was(one_thread):
    yield
    torch.use_deterministic_algorithms(False)


@pytest.mark.usefixtures("torch_as_it_was")
@pytest.mark.filterwarnings("ignore:.*holds 1 tasks that another configuration or other code has done")
@pytest.mark.parametrize("name", sorted(CHEAP))
def test_a_killed_run_goes_on(name, tmp_path, monkeypatch, root):
    folder, work = tmp_path / name, Work()
    folder.mkdir()
    for path in (*(EXPERIMENTS / name).glob("*.py"), *(EXPERIMENTS / name).glob("*.yaml")):
        shutil.copy(path, folder)
    monkeypatch.chdir(root)  # where configurations that name files begin
    with scripts_in(folder) as load:
        run = load("run")
        monkeypatch.setattr(sys, "argv", ["run.py", *(CHEAP[name](run, work) or [])])
        first, second = work.killed(run.main)
        assert first != second
        (partial,) = folder.rglob("*partial*" if name == "segmentation" else "*.jsonl")
        assert len(partial.read_text(encoding="utf-8").splitlines()) == 1
        # The same tasks under other code begin anew.
        (folder / "more.py").write_text("")
        assert work.killed(run.main) == [first, second]
        (folder / "more.py").unlink()
        # A kill in the midst of a line.
        with partial.open("a") as file:
            file.write('{"task": {"par')
        rest = work.whole(run.main)
    assert rest[0] == second
    assert first not in rest
    assert "config" in read_results(folder / "results.json")
    assert not partial.exists()
