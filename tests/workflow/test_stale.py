"""Which results are out of date: after a change exactly the dependents, whatever the times of files.

Results of the repository may be out of date: that fails no test. The clone of the tests is stamped first.
"""

import re

import pytest

from scripts import scripts_in

RECIPES = "src/meshot/synth/recipes/"
_SHIPPED = "people|people_adaptation|(shipped|windows_alone)_.*|study|cost_reconstruction|cost_study|speed_page"
_SHIPPED += "|person|shown_person|warnings|warnings_second|thickness|topology|pial_(left|right)"
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


@pytest.fixture(scope="module")
def code_digests():
    return {}


@pytest.fixture
def stale(part, monkeypatch, code_digests):
    """The results that are out of date, for changes of settings: the code of all tasks is read once."""
    usual = part("stale").Results._code

    def read_once(self, starts):
        if starts not in code_digests:
            code_digests[starts] = usual(self, starts)
        return code_digests[starts]

    monkeypatch.setattr(part("stale").Results, "_code", read_once)
    return lambda place, planned=False: part("stale").opened(root=place).stale(planned)


def edited(place, name, old, new):
    text = (place / name).read_text(encoding="utf-8")
    changed, count = re.subn(old, new, text, count=1, flags=re.M)
    assert count == 1
    (place / name).write_text(changed, encoding="utf-8")


@pytest.fixture(scope="module")
def clone(fresh, tmp_path_factory, root):
    """A clone whose results were all vouched for."""
    place = fresh(tmp_path_factory.mktemp("clone") / "repository")
    with scripts_in(root / "workflow") as load:
        results = load("stale").opened(root=place)
        results.vouch(
            [t for t in results.graph.tasks.values() if t.writes and not t.derived and not results.is_planned(t)]
        )
    return place


@pytest.fixture
def restored(clone):
    """Puts a file back."""
    before = {}

    def keep(name):
        before[clone / name] = (clone / name).read_bytes()

    yield keep
    for path, content in before.items():
        path.write_bytes(content)


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


#: What neither makes a cohort, nor reads one or its networks, nor registers a scan.
_WITHOUT_SCANS = """axioms|beyond_random|blur|circle_to_polygon|convergence|directions|encoding_rates|exact_value|
floors|ground_cost|normal_scale|sample_gradient|self_intersection|transport_rates|weights_and_areas|deforming|
fixed_supports.*|fsaverage5_flow|mni152|paper_table|slices|cost|cost_ruler|cost_windows|cost_batches""".replace(
    "\n", ""
)


def test_changed_code_makes_exactly_its_dependents_stale_and_a_comment_none(part, clone, restored):
    registration, command = "src/meshot/volume/registration.py", "src/meshot/cli/quality.py"
    for name in (registration, command):
        restored(name)
        (clone / name).write_text("# A remark.\n" + (clone / name).read_text(encoding="utf-8"), encoding="utf-8")
    assert part("stale").opened(root=clone).stale() == {}
    edited(clone, registration, r"^(def register_affine.*)seed: int = 0", r"\1seed: int = 1")
    results = part("stale").opened(root=clone)
    stale, tasks = results.stale(), results.graph.tasks.items()
    results_there = {name for name, task in tasks if task.writes and not results.is_planned(task)}
    assert {name for name in results_there - set(stale) if not re.fullmatch(_WITHOUT_SCANS, name)} == set()
    assert {name for name in stale if re.fullmatch(_WITHOUT_SCANS, name)} == set()
    assert stale["person"][0] == "its code has changed"
    (why,) = (reason for reason in stale["ddot"] if reason.startswith("initial_adni_like"))
    assert "cohort_adni_like has changed (its code has changed)" in why


@pytest.mark.thorough
def test_snakemake_has_nothing_to_do_and_after_a_changed_recipe_its_dependents(snakemake, clone, restored):
    found = snakemake(clone, "-n")
    assert found.returncode == 0
    assert "Nothing to be done" in found.stdout, found.stdout
    recipe = "src/meshot/synth/recipes/test_retest.yaml"
    restored(recipe)
    edited(clone, recipe, "^seed: ", "seed: 1")
    found = snakemake(clone, "-n", "--profile", "workflow/profiles/laptop")
    counts = {name: int(count) for name, count in re.findall(r"^(\w+) +(\d+)$", found.stdout, re.M)}
    assert counts == {"all": 1, "cohort": 5, "evaluation": 4, "table": 2, "total": 12}, found.stdout
    assert "study: src/meshot/synth/recipes/test_retest.yaml has changed" in found.stdout
    assert not list(clone.rglob("*.lock"))
