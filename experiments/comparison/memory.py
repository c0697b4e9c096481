"""Print the peak of the memory that one reconstruction adds to a process, in MB. ``run.py`` starts it for every system.

``python experiments/comparison/memory.py --unit NAME --subject NAME``
"""

import contextlib
import ctypes
import gc
import re
import subprocess
import sys
from pathlib import Path

import torch

from meshot.pipeline import InitialSurfaces
from meshot.synth import read_subject

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.scanned import seen
from trials.training import Training, arguments, finals, read_config, segmentation_network, trained_system

STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def peak_of(unit: Training, subject: str, config_file: Path) -> float | None:
    """The peak in MB, measured in a new process. None if this system does not report memory."""
    if not RESET.exists():
        return None
    words = ["--config", str(config_file), "--unit", unit.name, "--subject", subject]
    done = subprocess.run([sys.executable, __file__, *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"the memory of {unit.name} was not measured: {done.stderr.strip().splitlines()[-1:]}")
    return float(done.stdout.split()[-1])


def _status(name: str) -> int:
    """A line of the status of this process, in kB."""
    return int(re.search(rf"^{name}:\s+(\d+) kB", STATUS.read_text(encoding="utf-8"), re.M)[1])


def main(words: list[str] | None = None) -> None:
    """Reconstruct one scan and print the peak."""
    parser = arguments(__doc__, Path(__file__).parent)
    parser.add_argument("--unit", required=True, help="the name of a training")
    parser.add_argument("--subject", required=True, help="a subject of its cohort")
    asked = parser.parse_args(words)
    config = read_config(asked.config)
    torch.set_num_threads(config["evaluation"]["n_threads"])
    (unit,) = (each for each in finals(config) if each.name == asked.unit)
    surfaces = InitialSurfaces(Path(config["state"]) / "initial", segmentation_network(config))
    scan = seen(read_subject(config["evaluation"]["cohorts"][unit.cohort], asked.subject), surfaces)
    system = trained_system(unit, unit.kept(config))
    gc.collect()
    with contextlib.suppress(OSError):  # without it, the call may reuse memory that was freed before
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    RESET.write_text("5", encoding="utf-8")  # reset the peak
    before = _status("VmRSS")
    with contextlib.suppress(ValueError):  # a surface that is not found takes memory, too
        system.reconstruct(scan.given(type(system)))
    print(f"{max(0, _status('VmHWM') - before) / 1000:.1f}")


if __name__ == "__main__":
    main()
