"""The workflow of a study: its commands parse, its profiles are YAML, Snakemake plans it where it is installed, and the
recipes of containers agree with each other and copy what there is.
"""

import importlib.util
import json
import re
import shlex
import subprocess
import sys
import tomllib

import pytest
import yaml

from bids_trials import new_dataset
from meshot.cli import make_parser

PLACES = {
    "bids": "BIDS",
    "out": "OUT",
    "layout": "bids",
    "options": "--initial-only",
    "participant": "01",
    "threads": "1",
}


def commands(snakefile: str) -> list[str]:
    """The commands of meshot in the rules, with a value in every place."""
    lines = re.sub(r'"\n\s*"', "", snakefile)
    texts = re.findall(r'^\s+"(meshot .*)"$', lines, re.M)
    filled = [re.sub(r"\{(?:params\.|wildcards\.)?(\w+)\}", lambda m: PLACES.get(m[1], m[1]), text) for text in texts]
    return [part.split(" > ")[0].strip() for text in filled for part in text.split("&&")]


def test_the_commands_of_the_rules_parse(root):
    found = commands((root / "workflow" / "study.smk").read_text(encoding="utf-8"))
    assert [shlex.split(line)[1] for line in found] == ["reconstruct", "quality", "reconstruct"]
    for line in found:
        make_parser().parse_args(shlex.split(line)[1:])


def test_the_profiles_keep_going_and_name_what_a_cluster_needs(root):
    laptop, slurm = (
        yaml.safe_load((root / "workflow/profiles" / name / "config.yaml").read_text(encoding="utf-8"))
        for name in ("laptop", "slurm")
    )
    assert laptop["keep-going"] is slurm["keep-going"] is True
    assert slurm["executor"] == "slurm"
    assert {entry.split("=")[0] for entry in slurm["default-resources"]} == {"slurm_account", "slurm_partition"}


@pytest.mark.skipif(importlib.util.find_spec("snakemake") is None, reason="snakemake is not installed")
def test_snakemake_plans_a_job_for_each_participant(root, tmp_path):
    dataset = new_dataset(tmp_path / "raw")
    for name in ("sub-01", "sub-02"):
        (dataset / name).mkdir()
    words = ["-s", str(root / "workflow/Snakefile"), "--profile", str(root / "workflow/profiles/laptop"), "-n"]
    settings = ["--config", f"bids={dataset}", f"out={tmp_path / 'out'}"]
    command = [sys.executable, "-m", "snakemake", *words]
    planned = subprocess.run([*command, *settings], capture_output=True, encoding="utf-8", check=True, cwd=tmp_path)
    assert re.search(r"^participant +2$", planned.stdout + planned.stderr, re.M)
    refused = subprocess.run(
        [*command, "--config", "out=x"], capture_output=True, encoding="utf-8", check=False, cwd=tmp_path
    )
    assert "there is no setting bids" in refused.stdout + refused.stderr


def docker_steps(text: str) -> list[tuple[str, str]]:
    """Instructions and arguments, without comments and with continued lines joined."""
    lines = re.sub(r"\\\n\s*", "", re.sub(r"^#.*\n", "", text, flags=re.M)).splitlines()
    return [tuple(line.split(maxsplit=1)) for line in lines if line]


def apptainer_sections(text: str) -> dict[str, list[str]]:
    head, *parts = re.split(r"^%(\w+)\n", text, flags=re.M)
    found = {
        name: [line.strip() for line in body.splitlines() if line.strip()]
        for name, body in zip(parts[::2], parts[1::2])
    }
    return {"head": [line for line in head.splitlines() if line and not line.startswith("#")]} | found


@pytest.fixture
def recipes(root):
    texts = [(root / "workflow" / name).read_text(encoding="utf-8") for name in ("Dockerfile", "apptainer.def")]
    return docker_steps(texts[0]), apptainer_sections(texts[1])


def test_both_containers_are_made_in_the_same_way(recipes):
    steps, sections = recipes
    runs = [argument for instruction, argument in steps if instruction == "RUN"]
    known = {"FROM", "ARG", "ENV", "WORKDIR", "COPY", "RUN", "ENTRYPOINT", "CMD"}
    assert {instruction for instruction, _ in steps} == known
    assert sections["head"] == ["Bootstrap: docker", f"From: {dict(steps)['FROM']}"]
    assert sections["arguments"] == [f"torch_index={dict(steps)['ARG'].removeprefix('TORCH_INDEX=')}"]
    shared = [part.strip() for part in runs[0].replace("$TORCH_INDEX", "{{ torch_index }}").split("&&")]
    assert sections["post"][-len(shared) :] == shared
    assert json.loads(dict(steps)["ENTRYPOINT"]) == ["meshot", "reconstruct"]
    assert sections["runscript"] == ['exec meshot reconstruct "$@"']


def test_containers_copy_what_there_is_and_install_extras_that_there_are(root, recipes):
    steps, sections = recipes
    copied = {name for instruction, argument in steps if instruction == "COPY" for name in argument.split()[:-1]}
    assert copied == {line.split()[0] for line in sections["files"]}
    allowed = (root / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert copied == {line.removeprefix("!") for line in allowed if line.startswith("!")}
    assert all((root / name).exists() for name in copied)
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = re.search(r"'\.\[(.*)\]'", "".join(sections["post"]))[1].split(",")
    assert set(extras) <= set(project["optional-dependencies"])
    assert re.search(r"^torch==", (root / "requirements.lock").read_text(encoding="utf-8"), re.M)


def test_the_steps_are_shell(recipes):
    steps, sections = recipes
    texts = ["\n".join(sections[name]) for name in ("post", "environment", "runscript")]
    for text in [*texts, *(argument for instruction, argument in steps if instruction == "RUN")]:
        subprocess.run(["sh", "-n", "-c", text], check=True)
