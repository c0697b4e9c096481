"""What runs the repository elsewhere: workflows, containers, Binder; tried here as far as it goes without a host."""

import json
import os
import re
import shutil
import subprocess

import pytest
import yaml


def commands(text: str) -> list[str]:
    """Every shell command of a workflow."""
    found = yaml.safe_load(text)
    jobs = found["jobs"].values() if "jobs" in found else [job for job in found.values() if isinstance(job, dict)]
    lines = [step["run"] for job in jobs for step in job.get("steps", []) if "run" in step]
    return lines + [line for job in jobs for line in job.get("script", [])]


@pytest.mark.parametrize("name", [".github/workflows/book.yml", ".gitlab-ci.yml"])
def test_a_workflow_runs_what_exists(root, name):
    found = commands((root / name).read_text(encoding="utf-8"))
    assert {".ci/run", "make html slides pdf", "tools/publish.sh public"} <= set(found)
    targets = re.findall(r"^([\w-]+):", (root / "Makefile").read_text(encoding="utf-8"), re.M)
    for command in found:
        if command.startswith("make "):
            assert set(command.split()[1:]) <= set(targets)
        for script in re.findall(r"^(\S+/\S+)", command):
            assert os.access(root / script, os.X_OK), script


def test_the_containers_install_the_locked_environment(root):
    settings = json.loads((root / ".devcontainer" / "devcontainer.json").read_text(encoding="utf-8"))
    assert settings["postCreateCommand"] == "bash binder/postBuild"
    script = root / "binder" / "postBuild"
    assert os.access(script, os.X_OK)
    assert "requirements.lock" in script.read_text(encoding="utf-8")
    subprocess.run(["bash", "-n", script], check=True)


def test_published_pages_are_whole_and_not_for_jekyll(root, tmp_path):
    (tmp_path / "tools").mkdir()
    shutil.copy(root / "tools" / "publish.sh", tmp_path / "tools")
    command = ["bash", tmp_path / "tools" / "publish.sh", "public"]
    refused = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert (refused.returncode, refused.stderr) == (1, "there is no rendered book; run make html first\n")
    (tmp_path / "build" / "html" / "_static").mkdir(parents=True)
    (tmp_path / "build" / "html" / "index.html").touch()
    (tmp_path / "build" / "meshes_as_measures.pdf").touch()
    subprocess.run(command, check=True)
    shown = {path.name for path in (tmp_path / "public").iterdir()}
    assert shown == {"_static", "index.html", "meshes_as_measures.pdf", ".nojekyll"}
