"""The cost of the workflow: the page is current, the simulation keeps to its bounds."""

import pytest

from refusals import refuses


@pytest.fixture
def scaling(part):
    return part("scaling")


@pytest.fixture
def jobs(part, scaling):
    def make(**entries):
        """Jobs from (seconds, cores, tasks before)."""
        task = part("tasks").Task
        return {
            name: scaling.Job(task(name, "s", "x", after=tuple(after)), seconds, cores, grows=name.startswith("g"))
            for name, (seconds, cores, after) in entries.items()
        }

    return make


def test_the_page_is_current(scaling, part, root):
    text = (root / "book" / "speed.md").read_text(encoding="utf-8")
    block = scaling.block(part("stale").opened())
    assert f"<!-- workflow -->\n{block}\n<!-- /workflow -->" in text, "run: python workflow/scaling.py"


def test_the_simulation_agrees_with_what_is_known(scaling, jobs):
    apart = jobs(**{f"j{i}": (10.0, 1, ()) for i in range(8)})
    assert [scaling.makespan(apart, nodes, cores=2) for nodes in (1, 2, 4, 9)] == [40.0, 20.0, 10.0, 10.0]
    chain = jobs(a=(5.0, 1, ()), b=(7.0, 2, ["a"]), c=(1.0, 1, ["a"]), d=(2.0, 1, ["b", "c"]))
    assert [scaling.makespan(chain, nodes, cores=2) for nodes in (1, 3)] == [15.0, 14.0]
    assert [job.task.name for job in scaling.longest_chain(chain)] == ["a", "b", "d"]
    assert scaling.remaining(chain) == {"a": 14.0, "b": 9.0, "c": 3.0, "d": 2.0}
    refuses("b needs more than the 1 cores of a node", scaling.makespan, chain, 2, cores=1)


def test_the_simulation_lies_between_its_bounds(scaling, part):
    found, _ = scaling.jobs_of(part("stale").opened())
    chain = max(scaling.remaining(found).values())
    work = sum(job.seconds * job.cores for job in found.values())
    assert scaling.makespan(found, len(found)) == pytest.approx(chain)  # no job waits for a node
    # Graham's bound: while a job waits, a node has fewer free cores than the widest job needs; else the chain goes on.
    # The widest jobs are cohorts, which take all cores of a node, so that the bound is far from tight.
    busy = scaling.CORES - max(job.cores for job in found.values()) + 1
    for nodes in scaling.NODES:
        time = scaling.makespan(found, nodes)
        assert max(chain, work / scaling.CORES / nodes) * (1 - 1e-9) <= time <= chain + work / busy / nodes
