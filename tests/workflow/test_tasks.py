"""The graph of the experiments: nothing is left out, every command can start, and mistakes in a graph are named."""

import builtins
import io
import shlex
from pathlib import Path

import pytest
import yaml

from meshot.cli import make_parser
from meshot.systems import get_system, system_names
from meshot_book.claims import ledger_page
from meshot_book.claims.rules import RULES
from meshot_book.notebook import checksum_lines
from refusals import refuses
from trials.training import finals, read_config


@pytest.fixture
def graphs(part, root):
    return {"experiments": part("tasks").read_graph(root / "workflow" / "experiments.yaml", root)}


def test_every_experiment_and_every_network_is_a_task(graphs, root):
    written = {path for task in graphs["experiments"].tasks.values() for path in task.writes}
    results = {p.relative_to(root).as_posix() for p in (root / "experiments").glob("*/results.json")}
    assert results - written == set()
    networks = {
        f"{name}_{each.name}"
        for name, protocol in (
            ("ddot", "ddot/config"),
            ("comparison", "comparison/config"),
            ("rivals", "comparison/rivals"),
        )
        for each in finals(read_config(root / "experiments" / f"{protocol}.yaml"))
    }
    kinds = ("ddot_", "comparison_", "rivals_")
    assert {name for name in graphs["experiments"].tasks if name.count("_") > 3 and name.startswith(kinds)} == networks


def test_every_command_can_start_and_every_setting_is_there(graphs, root):
    graph = graphs["experiments"]
    for task in graph.tasks.values():
        words = shlex.split(task.command.replace("{cores}", "2"))
        if words[0] == "meshot":
            make_parser().parse_args(words[1:])
        else:
            assert words[0] == "python"
            assert words[1] == "-m" or (root / words[1]).is_file(), task.command
        assert all((root / read.partition("#")[0]).is_file() for read in task.reads if not task.planned), task.name
        assert task.starts or task.stage == "tool", f"{task.name} needs a script, or an entry under code"
        assert set(task.after) <= set(graph.tasks)
        assert task.writes or task.makes or task.stage == "initial"


def test_the_short_names_of_systems_mean_their_classes(root):
    short = yaml.safe_load((root / "workflow" / "experiments.yaml").read_text(encoding="utf-8"))["code"]
    classes = {name: get_system(name) for name in system_names()}
    assert short == {name: f"{kind.__module__}.{kind.__qualname__}" for name, kind in classes.items()}


@pytest.fixture
def opened(monkeypatch):
    """The files that are opened during a test, so far."""
    found, usual = [], io.open

    def noted(file, *words, **settings):
        found.append(file)
        return usual(file, *words, **settings)

    for module in (io, builtins):
        monkeypatch.setattr(module, "open", noted)
    return lambda: {Path(file).resolve() for file in found if not isinstance(file, int)}


def test_the_ledger_comes_after_every_task_whose_files_it_reads(graphs, root, opened):
    tasks = graphs["experiments"].tasks
    ledger_page(root / "book" / "claims.yaml", root / "experiments", RULES)
    checksum_lines(root / "experiments")
    read = [path for path in opened() if path.is_relative_to(root)]
    makers = {
        task.name
        for task in tasks.values()
        if any(path.is_relative_to(root / written) for written in task.writes for path in read)
    }
    assert {"readings", "controls", "ddot", "axioms", "ddot_oasis_like_left_ddot_0"} <= makers
    assert makers - {*tasks["ledger"].after, "ledger"} == set()


def test_the_page_of_costs_comes_after_every_task_whose_seconds_it_sums(part, graphs, root):
    scaling, tasks = part("scaling"), graphs["experiments"].tasks
    before, more = set(), {"scaling"}
    while more:
        before |= more
        more = {up for name in more for up in tasks[name].after} - before
    results = [task for task in tasks.values() if task.writes and all((root / path).exists() for path in task.writes)]
    summed = {task.name for task in results if scaling.recorded(root, task) is not None}
    assert {"readings", "comparison_rates", "people_segmentation", "cost"} <= summed
    assert summed - before == set()


def test_a_page_does_not_wait_for_a_planned_task_without_result(part, root):
    results = part("stale").opened()
    for name in ("ledger", "scaling"):
        task = results.graph.tasks[name]
        assert any(results.is_planned(results.graph.tasks[up]) for up in task.after)
        assert not any(results.is_planned(up) for up in results.before(task))
        waited = {path.parent.name for path in results.needed(task)}
        assert waited <= set(results.stale()), name


@pytest.mark.parametrize(
    ("graph", "protocol"),
    [("experiments", "experiments/comparison/config.yaml"), ("miniature", "workflow/miniature/comparison.yaml")],
)
def test_initial_surfaces_are_made_where_trainings_read_them(part, root, graph, protocol):
    """Those of other scans, such as test-retest pairs, are made by the measurement, in a folder of its own."""
    config = yaml.safe_load((root / protocol).read_text(encoding="utf-8"))
    tasks = part("tasks").read_graph(root / "workflow" / f"{graph}.yaml", root).tasks.values()
    commands = [shlex.split(task.command) for task in tasks if "initial_surfaces.py" in task.command]
    own = [words for words in commands if words[words.index("--into") + 1] == config["initial"]]
    assert sorted(words[2] for words in own) == sorted(config["cohorts"].values())


def test_surfaces_from_which_the_flows_of_the_package_start_are_made_once(graphs):
    tasks = graphs["experiments"].tasks
    makers = [task for name, task in tasks.items() if name.startswith("people_initial_")]
    commands = [shlex.split(task.command) for task in makers]
    ((into, segmentation),) = {(words[words.index("--into") + 1], words[-1]) for words in commands}
    for name in ("shipped_left", "shipped_right", "windows_alone_left", "windows_alone_right"):
        own = shlex.split(tasks[name].command)
        assert own[own.index("--initial") + 1] == into
        assert own[own.index("--segmentation") + 1] == segmentation
        assert sorted(own[own.index("--data") + 1 : own.index("-o")]) == sorted(words[2] for words in commands)
        assert set(tasks[name].after) == {task.name for task in makers}


#: What a stage allows, at least, as a multiple of what its tasks took.
MARGIN = 1.5


def test_no_task_took_as_long_as_its_stage_allows(part, graphs, root):
    scaling, graph = part("scaling"), graphs["experiments"]
    results = [task for task in graph.tasks.values() if all((root / path).exists() for path in task.writes)]
    took = {task.name: (task.stage, scaling.recorded(root, task) or 0.0) for task in results}
    assert min(took[name][1] for name in ("readings", "comparison", "convergence", "segmentation_training")) > 1000
    late = {n: s for n, (stage, s) in took.items() if MARGIN * s > 60 * graph.stages[stage]["minutes"]}
    assert late == {}, "raise the minutes of the stage"


ENTRY = "  b:\n    stage: s\n    command: x\n"
STAGES = "stages:\n  s: {cores: 1, memory_mb: 1, minutes: 1, cuda: 0}\n"
WRONG = [
    (STAGES.replace(", cuda: 0", "") + "tasks:\n" + ENTRY, "state cores, memory_mb, minutes, cuda"),
    (STAGES + "tasks:\n" + ENTRY + "    befor: [a]\n", "b has befor; possible are after"),
    (STAGES + "tasks:\n" + ENTRY.replace("stage: s", "stage: t"), "the unknown stage t"),
    (STAGES + "tasks:\n" + ENTRY + "    each: {n: [1, 2]}\n", "two tasks b"),
    (STAGES + "tasks:\n" + ENTRY + "    after: [c]\n", "comes after c, which is no task"),
    (
        STAGES + "tasks:\n" + ENTRY + "    after: [c]\n" + ENTRY.replace("b:", "c:") + "    after: [b]\n",
        "wait for each",
    ),
]


def test_an_arm_reads_the_settings_of_its_system(part):
    column = {"cohorts": ["a"], "sides": ["left"], "seeds": [0], "budget": "steps", "arms": ["near", "ddot"]}
    config = {"settings": "small", "groups": {"steps": column}, "arms": {"near": {"system": "windows"}, "ddot": {}}}
    found = {each["training"]: each["system"] for each in part("tasks")._trainings(config)}
    assert found == {"a_left_near_steps_0": "windows", "a_left_ddot_steps_0": "ddot"}


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_a_mistake_is_named(part, tmp_path, text, message):
    file = Path(tmp_path, "graph.yaml")
    file.write_text(text)
    refuses(message, part("tasks").read_graph, file, tmp_path)
