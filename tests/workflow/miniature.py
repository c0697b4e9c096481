"""Run the miniature of all experiments, killed and started again, and compare: ``python tests/workflow/miniature.py``.

Every system is trained on a tiny cohort, reconstructs a scan, and is measured, once without a kill and once with some.
The exit status is 1 if the table or a network differs, or the second start of a whole workflow does anything.
"""

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from safetensors.numpy import load_file

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("workflow", "experiments", "src")
STATE, BUILT = Path("build/workflow/miniature"), Path("build/miniature")
TABLE = BUILT / "table.tsv"


def copied(place: Path) -> Path:
    """The files of the repository in a new folder."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in filter(lambda name: (ROOT / name).is_file(), listed.stdout.splitlines()):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, place / name)
    return place


def started(place: Path, cores: int, *words: str) -> subprocess.Popen:
    """Snakemake on the miniature, in a process group of its own."""
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--nolock", "--config", "graph=miniature"]
    paths = os.pathsep.join(filter(None, (str(place / "src"), os.environ.get("PYTHONPATH", ""))))
    with (place / "output.txt").open("a") as output:
        return subprocess.Popen(
            [*command, *words], cwd=place, env=os.environ | {"PYTHONPATH": paths}, start_new_session=True,
            stdout=output, stderr=output,
        )  # fmt: skip


def killed(place: Path, cores: int, stamps: int) -> None:
    """Start the workflow, and kill it soon after so many tasks have ended."""
    process = started(place, cores)
    while process.poll() is None and len(list((place / STATE).glob("*/*/*.json"))) < stamps:
        time.sleep(0.05)
    time.sleep(random.Random(stamps).uniform(0.5, 3.0))
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def finished(place: Path, cores: int) -> float:
    """Run the workflow to its end. Returns the seconds.

    Raises
    ------
    ValueError
        If it fails, or a second start does anything.
    """
    since = time.monotonic()
    if started(place, cores).wait():
        logs = "\n".join(path.read_text() for path in (place / STATE / "logs").glob("*.log"))
        raise ValueError(f"the workflow failed\n{logs}\n{(place / 'output.txt').read_text()}")
    seconds = time.monotonic() - since
    if started(place, cores).wait() or "Nothing to be done" not in (place / "output.txt").read_text().splitlines()[-1]:
        raise ValueError(f"the second start did not end with nothing to do\n{(place / 'output.txt').read_text()}")
    return seconds


def results_of(place: Path) -> dict[str, str]:
    """The digests of the table and of the weights of all networks. Their records state seconds, and differ."""
    found = {str(TABLE): _digest((place / TABLE).read_bytes())}
    for path in sorted((place / BUILT / "trained").glob("*/*.safetensors")):
        weights = load_file(path)
        content = b"".join(name.encode() + weights[name].tobytes() for name in sorted(weights))
        found[str(path.relative_to(place))] = _digest(content)
    return found


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def main(words: list[str] | None = None) -> int:
    """Run both, compare, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="default: all")
    parser.add_argument("--kills", type=int, default=3, help="number of kills (default: %(default)s)")
    asked = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        whole, broken = (copied(Path(folder) / name) for name in ("whole", "broken"))
        print(f"without a kill: {finished(whole, asked.cores):.0f} s", flush=True)
        for number in range(asked.kills):
            killed(broken, asked.cores, 1 + 6 * number)
        print(f"after {asked.kills} kills, the rest: {finished(broken, asked.cores):.0f} s", flush=True)
        print((whole / TABLE).read_text())
        first, second = results_of(whole), results_of(broken)
        differ = sorted(name for name in first.keys() | second.keys() if first.get(name) != second.get(name))
    print(f"{len(first)} files are the same" if not differ else f"these differ: {', '.join(differ)}")
    return int(bool(differ))


if __name__ == "__main__":
    sys.exit(main())
