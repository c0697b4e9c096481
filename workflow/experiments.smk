# Everything in experiments/, from the cohorts to the ledger: what is out of date runs, on a laptop or a cluster.
#
#   python -m snakemake -n
#   python -m snakemake --profile workflow/profiles/laptop
#   python -m snakemake --profile workflow/profiles/slurm
#
# Settings (--config NAME=VALUE):
#   graph    the name of a YAML file with tasks (default: experiments)
#   planned  yes: also the tasks that have no result yet; no (default): without them
#
# The tasks stand in GRAPH.yaml. stale.py says which results are out of date, from the digests of settings, inputs and
# code. A task that has ended leaves a stamp in build/workflow, whose name is the version of its result: Snakemake makes
# the stamps that are missing, and the times of files do not matter.
import os
import sys

sys.path.insert(0, workflow.basedir)
# Tasks run in the environment of Snakemake, also if it is not active.
os.environ["PATH"] = os.pathsep.join((os.path.dirname(sys.executable), os.environ.get("PATH", "")))

import run_task

NAME, PLANNED = config.get("graph", "experiments"), run_task.yes_or_no("planned", config.get("planned", False))
RESULTS = run_task.opened(NAME)
RESULTS.drop_false_stamps()
TASKS, STALE = RESULTS.graph.tasks, RESULTS.stale(PLANNED)
WAITING = [] if PLANNED else [name for name, task in TASKS.items() if RESULTS.is_planned(task)]
WORDS = f"--graph {NAME}" + (" --planned" if PLANNED else "")


workdir: run_task.ROOT


container: "meshot.sif"


if STALE:

    rule all:
        """The digests of the new results."""
        input:
            ancient([RESULTS.stamp(TASKS[name], PLANNED) for name in STALE]),
        params:
            words=WORDS,
        localrule: True
        shell:
            "python workflow/run_task.py collect {params.words}"

else:

    rule all:
        """Nothing is out of date."""
        input:
            ancient(run_task.ROOT / "workflow" / f"{NAME}.yaml"),


for stage, most in RESULTS.graph.stages.items():

    rule:
        """The tasks of a stage."""
        name:
            stage
        input:
            ancient(lambda found: RESULTS.needed(TASKS[found.task], PLANNED)),
        output:
            RESULTS.state / stage / "{task}" / "{version}.json",
        log:
            RESULTS.state / "logs" / "{task}-{version}.log",
        params:
            words=WORDS,
            reasons=lambda found: "; ".join(STALE.get(found.task, ["another task needs it"])),
        threads: most["cores"]
        resources:
            mem_mb=most["memory_mb"],
            runtime=most["minutes"],
            gpu=most["cuda"],
        message:
            "{wildcards.task}: {params.reasons}"
        shell:
            "python workflow/run_task.py run {wildcards.task} --cores {threads} {params.words} > {log} 2>&1"


onstart:
    if WAITING:
        print(f"{len(WAITING)} tasks have no result yet and wait for --config planned=yes: {', '.join(WAITING)}")
