"""Build the wheel, install it in an empty environment, and run there what README shows.

``make test-wheel``, some ten minutes and 2 GB: the losses alone first, then the extra ``cortex``, then ``bids``.
Versions are those of ``requirements.lock``; kernels are compiled anew.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "book"))
from editions import build_wheel  # noqa: E402

MOST_BYTES = 12e6
SURFACES = """
import meshot
from meshot.mesh.shapes import icosphere
meshot.write_mesh("predicted.ply", icosphere(2, 38.0))
meshot.write_mesh("lh.white.surf.gii", icosphere(2, 40.0))
open("pairs.tsv", "w").write("predicted\\ttarget\\npredicted.ply\\tlh.white.surf.gii\\n")
"""
COHORT = """
from importlib.resources import files
text = (files("meshot.synth") / "recipes" / "tiny.yaml").read_text(encoding="utf-8")
assert "split: {train: 0.5, test: 0.5}" in text
open("two.yaml", "w").write(text.replace("test: 0.5", "validation: 0.5").replace("procedural_subjects: 1", ""))
from meshot.synth import read_recipe
assert [read_recipe(name).name for name in ("oasis_like", "adni_like", "test_retest", "tiny")]
"""
LOSSES = (
    "meshot --version",
    "meshot warmup",
    "meshot evaluate predicted.ply lh.white.surf.gii --definitions --points 2000 --emd-points 200",
    "meshot evaluate predicted.ply lh.white.surf.gii --points 2000 --emd-points 200 --json found.json",
    "meshot evaluate --pairs pairs.tsv --points 2000 --emd-points 200",
)
CORTEX = (
    "meshot make-cohort two.yaml cohort --jobs 2",
    "meshot make-cohort two.yaml cohort --check",
    "meshot train-segmentation tiny --data cohort -o trained --set training.n_epochs=1 training.reduction=4",
    "meshot train ddot tiny --data cohort -o flow --set training.n_epochs=1 training.validate_every=1",
    "meshot reconstruct {scan} -o found",
    "meshot reconstruct {scan} -o first --initial-only",
    "meshot reconstruct {scan} -o own --system ddot --weights flow",
)
#: Two scans that are no BIDS data set do not need the extra.
FILES = ("meshot reconstruct {scan} {copy} -o files --initial-only --quiet", "meshot quality files")
BIDS = (
    "meshot reconstruct {bids} study participant --initial-only --layout bids --verbose",
    "meshot reconstruct {bids} study group",
    "meshot quality study",
    "meshot table study study -o compared --points 2000 --emd-points 200",
)
READ = """
from meshot.study import find_surfaces, read_subjects
(row,) = read_subjects("study")
assert (row["participant_id"], row["status"], row["left_white_euler"]) == ("sub-001", "done", 2), row
assert len(find_surfaces("study")) == 2
"""


def pip(python: str, command: str, *words: str | Path) -> None:
    """Run an environment's pip."""
    subprocess.run([python, "-m", "pip", command, "-q", "--disable-pip-version-check", *map(str, words)], check=True)


def empty_environment(folder: Path) -> str:
    """The Python of a new environment that holds nothing."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    return str(folder / "bin" / "python")


def examples() -> list[str]:
    """The programs of README and of the page that the book starts with, each as one."""
    texts = [(ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "book/getting_started.md")]
    found = ["".join(re.findall(r"```python\n(.*?)```", text, re.S)) for text in texts]
    assert all(found)
    return found


def main() -> None:
    """Build, install, run; an error ends it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel, work = build_wheel(folder, solutions=True), folder / "work"
        size = wheel.stat().st_size
        print(f"{wheel.name}: {size / 1e6:.1f} MB", flush=True)
        assert size <= MOST_BYTES, f"the wheel has {size} bytes; at most {MOST_BYTES:.0f} are wanted"
        work.mkdir()
        python = empty_environment(folder / "environment")
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        environment["PATH"] = f"{Path(python).parent}{os.pathsep}{os.environ['PATH']}"

        def run(*words: str) -> None:
            subprocess.run(words, cwd=work, env=environment, check=True, stdout=subprocess.DEVNULL)

        def run_commands(commands: Iterable[str], **names: str) -> None:
            for command in commands:
                print(f"$ {command}", flush=True)
                run(*command.format(**names).split())

        pip(python, "install", "-c", ROOT / "requirements.lock", wheel)
        run(python, "-c", f"import meshot; assert meshot.__file__.startswith({name!r}), meshot.__file__")
        for code in (SURFACES, "\n".join(examples())):
            run(python, "-c", code)
        run_commands(LOSSES)
        pip(python, "install", "-c", ROOT / "requirements.lock", f"{wheel}[cortex]")
        run(python, "-c", COHORT)
        (scan,) = (ROOT / "data_synth" / "sample").glob("sub-*/**/*_T1w.nii.gz")
        run_commands(CORTEX, scan=str(scan))
        names = {"scan": str(scan), "bids": str(scan.parents[2]), "copy": str(shutil.copy(scan, work / "other.nii.gz"))}
        run_commands(FILES, **names)
        refused = subprocess.run(
            BIDS[0].format(**names).split(),
            cwd=work,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        assert refused.returncode == 2, refused
        assert "pip install 'meshot[bids]'" in refused.stderr, refused.stderr
        pip(python, "install", "-c", ROOT / "requirements.lock", f"{wheel}[cortex,bids]")
        run_commands(BIDS, **names)
        run(python, "-c", READ)
    print("the wheel does what README shows")


if __name__ == "__main__":
    main()
