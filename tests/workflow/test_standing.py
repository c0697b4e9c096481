"""Which results are out of date: none in a fresh clone, exactly the dependents after a change, whatever the times."""

import re

import pytest

RECIPES = "src/meshot/synth/recipes/"
_SHIPPED = "people|people_adaptation|(shipped|windows_alone)_.*|study|cost_reconstruction|cost_study|speed_page|person"
#: A file, an edit of a value in it, and the tasks that are then out of date, besides the ledger and the page of costs.
CHANGES = [
    (f"{RECIPES}test_retest.yaml", r"^seed: .*", "seed: 99",
     "cohorts|study|comparison(_pictures)?"),
    ("experiments/normal_scale/config.yaml", r"^smoothing_steps: .*", "smoothing_steps: 31", "normal_scale"),
    ("experiments/ddot/config.yaml", r"n_resamples: \d+", "n_resamples: 7", "ddot"),
    ("experiments/ddot/config.yaml", r"system: windows", "system: ddot", "ddot|ddot_.*_windowed_0"),
    ("src/meshot/systems/settings/cortexode/small.yaml", r"n_epochs: \d+", "n_epochs: 7",
     "ddot|ddot_.*_(cortexode|chamfer_varifold)_[0-4]|readings|candidates|controls|budget|one_subject|comparison.*"),
    (f"{RECIPES}oasis_like.yaml", r"^seed: .*", "seed: 99",
     "segmentation(_training)?|cohorts|template_baseline|ddot|ddot_.*|earlier_.*|descent_directions|held_out"
     f"|readings|candidates|controls|budget|one_subject|comparison.*|{_SHIPPED}"),
    (f"{RECIPES}people_like.yaml", r"^seed: .*", "seed: 99",
     f"people_segmentation|{_SHIPPED}"),
    ("experiments/ddot/readings.yaml", r"^rate_epochs: \d+", "rate_epochs: 7", "readings|candidates|controls"),
]  # fmt: skip


@pytest.fixture
def stale(part):
    return lambda place, planned=False: part("run_task").opened("experiments", place).stale(planned)


def edited(place, name, old, new):
    text = (place / name).read_text(encoding="utf-8")
    changed, count = re.subn(old, new, text, count=1, flags=re.M)
    assert count == 1
    (place / name).write_text(changed, encoding="utf-8")


@pytest.fixture(scope="module")
def clone(fresh, tmp_path_factory):
    return fresh(tmp_path_factory.mktemp("clone") / "repository")


@pytest.fixture
def restored(clone):
    """Puts a file back."""
    before = {}

    def keep(name):
        before[clone / name] = (clone / name).read_bytes()

    yield keep
    for path, content in before.items():
        path.write_bytes(content)


def test_nothing_is_out_of_date_in_a_fresh_clone(stale, clone):
    assert stale(clone) == {}


@pytest.mark.parametrize(("name", "old", "new", "expected"), CHANGES)
def test_a_changed_setting_makes_exactly_the_dependents_stale(part, stale, clone, restored, name, old, new, expected):
    restored(name)
    edited(clone, name, old, new)
    graph = part("tasks").read_graph(clone / "workflow" / "experiments.yaml", clone)
    there = [t for t in graph.tasks.values() if t.writes and all((clone / path).exists() for path in t.writes)]
    dependents = {task.name for task in there if re.fullmatch(expected, task.name)}
    assert set(stale(clone)) == dependents | {"ledger", "scaling"}


def test_comments_and_the_order_of_keys_do_not_matter(stale, clone, restored):
    name = "experiments/floors/config.yaml"
    restored(name)
    text = (clone / name).read_text(encoding="utf-8")
    (clone / name).write_text("# Another remark.\n" + text, encoding="utf-8")
    assert stale(clone) == {}


def test_a_missing_file_and_planned_tasks_are_named(stale, clone, restored):
    name = "experiments/mni152/velocity_left.safetensors.gz"
    restored(name)
    (clone / name).unlink()
    assert stale(clone)["mni152"] == [f"{name} is missing"]
    planned = set(stale(clone, planned=True)) - set(stale(clone))
    assert "ddot_adni_like_left_sliced_surface_0" in planned


def test_the_records_of_results_outweigh_the_file(part, clone, restored, stale):
    # A result that is made by hand counts at once: its record states its settings.
    config, results = ("experiments/normal_scale/" + name for name in ("config.yaml", "results.json"))
    restored(config)
    restored(results)
    edited(clone, config, r"^smoothing_steps: 30", "smoothing_steps: 31")
    edited(clone, results, r'"smoothing_steps": 30', '"smoothing_steps": 31')
    assert stale(clone) == {}
