"""The workflow of a study: its commands parse, its profiles are YAML, and Snakemake plans it where it is installed."""

import re
import shlex
import shutil
import subprocess

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
    found = commands((root / "workflow" / "Snakefile").read_text(encoding="utf-8"))
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


@pytest.mark.skipif(shutil.which("snakemake") is None, reason="snakemake is not installed")
def test_snakemake_plans_a_job_for_each_participant(root, tmp_path):
    dataset = new_dataset(tmp_path / "raw")
    for name in ("sub-01", "sub-02"):
        (dataset / name).mkdir()
    words = ["-s", str(root / "workflow/Snakefile"), "--profile", str(root / "workflow/profiles/laptop"), "-n"]
    settings = ["--config", f"bids={dataset}", f"out={tmp_path / 'out'}"]
    planned = subprocess.run(["snakemake", *words, *settings], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert re.search(r"^participant +2$", planned.stdout + planned.stderr, re.M)
    refused = subprocess.run(["snakemake", *words, "--config", "out=x"], capture_output=True, text=True, check=False)
    assert "there is no setting bids" in refused.stdout + refused.stderr
