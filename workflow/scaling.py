"""What the experiments cost, and what they would cost with more subjects on more machines: a section of the book.

Run as ``python workflow/scaling.py``. Seconds come from the records of the results. The time on several machines comes
from a simulation of the workflow: whenever cores are free, the task starts that has the longest way to the end of the
workflow before it.
"""

import dataclasses
import heapq
import json
import re
import sys
from pathlib import Path

import yaml
from stale import ROOT, Results, opened
from tasks import Task

from meshot.files import write_whole
from meshot.synth import read_recipe, visits
from meshot_book.notebook import digits, markdown_table

PAGE, MARKERS = "book/speed.md", ("<!-- workflow -->", "<!-- /workflow -->")
COHORTS = ("oasis_like", "adni_like")
SUBJECTS, NODES, CORES = 1000, (1, 16, 256), 16
PROFILE = "workflow/profiles/slurm/config.yaml"
#: A command that makes a cohort: the recipe, and the number of further held-out subjects.
MADE = re.compile(r"meshot make-cohort (\S+) (?:.*--held-out (\d+))?")
#: The parts of a reconstruction that make initial surfaces.
INITIAL = ("white matter", "initial surface, left", "initial surface, right")


@dataclasses.dataclass(frozen=True)
class Job:
    """A task with its cost: seconds on its cores, and the cores. Whether it grows with the number of subjects."""

    task: Task
    seconds: float
    cores: int
    grows: bool

    @property
    def processor_seconds(self) -> float:
        """Seconds of all its processors together. Only cohorts are recorded scan by scan, and spread over cores."""
        return self.seconds * (self.cores if self.task.stage == "cohort" else 1)


def recorded(root: Path, task: Task) -> float | None:
    """The processor seconds of a task, from the records of the results. None if no record states them."""
    if made := MADE.match(task.command):
        seconds = _results(root, "cohorts/results.json")["cpu_seconds"].get(made[1])
        return None if seconds is None else _scans(made[1], int(made[2] or 0)) * sum(seconds.values())
    if task.stage == "initial":
        parts = _results(root, "cost/reconstruction.json")["parts"]
        seconds = sum(part["CPU s"] for part in parts if part["part"] in INITIAL)
        return _scans(task.name.rpartition("initial_")[2]) * seconds
    for path in task.writes:
        records = sorted((root / path).glob("*.json")) if (root / path).is_dir() else [root / path]
        if records[0].suffix == ".json":
            return sum(json.loads(record.read_text(encoding="utf-8"))["seconds"] for record in records)
    return None


def _results(root: Path, name: str) -> dict:
    return json.loads((root / "experiments" / name).read_text(encoding="utf-8"))["results"]


def _scans(name: str, held_out: int = 0) -> int:
    recipe = dataclasses.replace(read_recipe(name), held_out_subjects=held_out)
    return len(visits(recipe)) * recipe.scans_per_day


def jobs_of(results: Results) -> tuple[dict[str, Job], list[str]]:
    """The tasks that have a result, or make what a result needs, and the names of those without a recorded time."""
    profile = yaml.safe_load((results.root / PROFILE).read_text(encoding="utf-8"))
    more = {name: int(cores) for name, cores in (entry.split("=") for entry in profile["set-threads"])}
    subjects = {f"{kind}_{name}" for kind in ("cohort", "held_out", "initial") for name in COHORTS}
    found, unknown = {}, []
    for task in results.graph.tasks.values():
        if results.is_planned(task):
            continue
        seconds = recorded(results.root, task)
        if seconds is None:
            unknown.append(task.name)
        cores = more.get(task.stage, results.graph.stages[task.stage]["cores"])
        grows = task.name in subjects or bool(subjects & set(task.after))
        spread = cores if task.stage == "cohort" else 1  # the others are recorded on their cores
        found[task.name] = Job(task, (seconds or 0.0) / spread, cores, grows)
    return found, unknown


def scaled(jobs: dict[str, Job], factor: float) -> dict[str, Job]:
    """The jobs for more subjects: what grows with the number of subjects grows in proportion."""
    return {n: dataclasses.replace(j, seconds=j.seconds * (factor if j.grows else 1)) for n, j in jobs.items()}


def remaining(jobs: dict[str, Job]) -> dict[str, float]:
    """The seconds from the start of each job to the end of the longest chain of jobs after it."""
    found: dict[str, float] = dict.fromkeys(jobs, 0.0)
    for name in reversed(jobs):
        found[name] += jobs[name].seconds
        for up in jobs[name].task.after:
            if up in found:
                found[up] = max(found[up], found[name])
    return found


def makespan(jobs: dict[str, Job], nodes: int, cores: int = CORES) -> float:
    """The simulated seconds of the whole workflow on several nodes. A job runs on one node."""
    if wide := [job.task.name for job in jobs.values() if job.cores > cores]:
        raise ValueError(f"{', '.join(wide)} needs more than the {cores} cores of a node; choose larger nodes")
    left, free = remaining(jobs), [cores] * nodes
    waits = {name: {up for up in job.task.after if up in jobs} for name, job in jobs.items()}
    running: list[tuple[float, str, int]] = []
    now = 0.0
    while waits or running:
        for name in sorted((n for n, before in waits.items() if not before), key=lambda n: -left[n]):
            node = next((i for i in range(nodes) if free[i] >= jobs[name].cores), None)
            if node is not None:
                free[node] -= jobs[name].cores
                heapq.heappush(running, (now + jobs[name].seconds, name, node))
                del waits[name]
        now, ended, node = heapq.heappop(running)
        free[node] += jobs[ended].cores
        for before in waits.values():
            before.discard(ended)
    return now


def longest_chain(jobs: dict[str, Job]) -> list[Job]:
    """The jobs that decide the time on any number of nodes, in order."""
    left = remaining(jobs)
    chain = [max(jobs.values(), key=lambda job: left[job.task.name])]
    while after := [job for job in jobs.values() if chain[-1].task.name in job.task.after]:
        chain.append(max(after, key=lambda job: left[job.task.name]))
    return [job for job in chain if job.seconds]


def block(results: Results) -> str:
    """The section: recorded seconds by stage, and the time with more subjects on more machines."""
    jobs, unknown = jobs_of(results)
    now = sum(len(visits(read_recipe(name))) for name in COHORTS)
    many = scaled(jobs, SUBJECTS / now)
    chain = longest_chain(many)
    hours = digits(sum(job.seconds for job in chain) / 3600, 3)
    steps = ", ".join(f"`{job.task.name}` ({digits(job.seconds / 3600, 2)} h)" for job in chain)
    cases = {f"h, {now} subjects": jobs, f"h, {SUBJECTS} subjects": many}
    nodes = [{"nodes": n} | {head: makespan(case, n) / 3600 for head, case in cases.items()} for n in NODES]
    return "\n".join(
        [
            f"Written by `python workflow/scaling.py` from the records of the committed results. The two cohorts "
            f"{' and '.join(COHORTS)} have {now} subjects together. The last column is the projection to {SUBJECTS}.",
            "",
            markdown_table(stage_table(jobs, many, f"h, {SUBJECTS} subjects"), 3),
            "",
            f"No time is recorded of {', '.join(f'`{name}`' for name in unknown)}. They count as 0 s. The whole "
            f"workflow takes {_hours(jobs)} processor hours with {now} subjects, and {_hours(many)} with {SUBJECTS}. "
            f"The next table has the time from start to end on nodes of {CORES} cores.",
            "",
            markdown_table(nodes, 3),
            "",
            f"The longest chain of tasks with {SUBJECTS} subjects takes {hours} h on any number of nodes: {steps}.",
        ]
    )


def _hours(jobs: dict[str, Job]) -> str:
    return digits(sum(job.processor_seconds for job in jobs.values()) / 3600, 3)


def stage_table(jobs: dict[str, Job], many: dict[str, Job], head: str) -> list[dict]:
    """Numbers of tasks and their processor time, by stage. The last column has the given head."""
    rows = []
    for stage in dict.fromkeys(job.task.stage for job in jobs.values()):
        own = [name for name, job in jobs.items() if job.task.stage == stage and job.seconds]
        now, then = ([found[name].processor_seconds for name in own] for found in (jobs, many))
        if own and max(now) >= 1:
            row = {"stage": stage, "tasks": len(own), "s": round(sum(now)), "s of the longest task": round(max(now))}
            rows.append(row | {head: sum(then) / 3600})
    return sorted(rows, key=lambda row: -row["s"])


def main() -> int:
    """Write the section into the page."""
    page = ROOT / PAGE
    text = page.read_text(encoding="utf-8")
    start, end = (text.index(marker) for marker in MARKERS)
    write_whole(page, f"{text[:start]}{MARKERS[0]}\n{block(opened('experiments'))}\n{text[end:]}")
    print(f"wrote {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
