"""Build the wheel, install it alone in an empty folder, and run there what README shows.

Part of ``make test-wheel``, some minutes: kernels are compiled anew. Other libraries are those of the environment.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MOST_BYTES = 12e6
SURFACES = """
import meshot
from meshot.mesh.shapes import icosphere
meshot.write_mesh("predicted.ply", icosphere(2, 38.0))
meshot.write_mesh("lh.white.surf.gii", icosphere(2, 40.0))
"""
COHORT = """
from importlib.resources import files
text = (files("meshot.synth.cohorts") / "tiny.yaml").read_text()
assert "split: {train: 0.5, test: 0.5}" in text
open("two.yaml", "w").write(text.replace("test: 0.5", "validation: 0.5").replace("procedural_subjects: 1", ""))
from meshot.synth.cohorts import read_recipe
assert [read_recipe(name).name for name in ("oasis_like", "adni_like", "test_retest", "tiny")]
"""
COMMANDS = (
    "meshot --version",
    "meshot evaluate predicted.ply lh.white.surf.gii --definitions --points 2000 --emd-points 200",
    "meshot evaluate predicted.ply lh.white.surf.gii --points 2000 --emd-points 200 --json found.json",
    "meshot make-cohort two.yaml cohort --jobs 2",
    "meshot make-cohort two.yaml cohort --check",
    "meshot train-segmentation tiny --data cohort -o trained --set training.n_epochs=1 training.reduction=4",
)


def build(folder: Path) -> Path:
    """The wheel, from a copy of what it is made of: what lies in ``build`` must not get in."""
    source = folder / "source"
    shutil.copytree(ROOT / "src", source / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip("wheel", "--no-build-isolation", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("*.whl")
    return wheel


def pip(command: str, *words: str | Path) -> None:
    """Run pip without what it might fetch."""
    subprocess.run([sys.executable, "-m", "pip", command, "-q", "--no-deps", *map(str, words)], check=True)


def losses_example() -> str:
    """The first block of Python in README."""
    return re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S).group(1)


def main() -> None:
    """Build, install, run; an error ends it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel, site, work = build(folder), folder / "site", folder / "work"
        size = wheel.stat().st_size
        print(f"{wheel.name}: {size / 1e6:.1f} MB", flush=True)
        assert size <= MOST_BYTES, f"the wheel has {size} bytes; at most {MOST_BYTES:.0f} are wanted"
        pip("install", "--target", site, wheel)
        work.mkdir()
        environment = os.environ | {"PYTHONPATH": str(site), "PATH": f"{site / 'bin'}{os.pathsep}{os.environ['PATH']}"}

        def run(*words: str) -> None:
            subprocess.run(words, cwd=work, env=environment, check=True, stdout=subprocess.DEVNULL)

        run(sys.executable, "-c", f"import meshot; assert meshot.__file__.startswith({str(site)!r}), meshot.__file__")
        for code in (SURFACES, losses_example(), COHORT):
            run(sys.executable, "-c", code)
        for command in COMMANDS:
            print(f"$ {command}", flush=True)
            run(*command.split())
    print("the wheel does what README shows")


if __name__ == "__main__":
    main()
