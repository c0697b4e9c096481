"""What writes is killed at random moments: nothing half-written stays, and a second start ends with the same bytes.

Every run is a process of its own, forked from one that has loaded everything, so that a run costs what it writes.
"""

import contextlib
import ctypes
import dataclasses
import gzip
import json
import os
import re
import resource
import signal
import subprocess
import tempfile
import time
import traceback
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from safetensors import safe_open

MARK = "MESHOT_KILL_TRIAL"
PATIENCE = 15.0  # seconds until whatever a killed process had started has to be gone
#: Entries of records that differ between two runs of the same thing.
VARYING = re.compile(r"second|clock|commit|started|processor|^date$")
REFUSED, BROKEN = 2, 1
_CAP_VERSION = 0x20080522


@dataclasses.dataclass(frozen=True)
class Writer:
    """Something that writes.

    Parameters
    ----------
    name : str
    write : callable
        Of a folder for what is written, and one with inputs. Called again, it goes on or begins anew.
    growing : str
        A regular expression: names of files that grow or are replaced while it runs, and may be there in any state that
        can be read.
    timed : str
        Names of files that tell seconds in words, so that their bytes are not compared.
    failure : int
        The exit status where there is no room left, or where another run has written the same.
    """

    name: str
    write: Callable[[Path, Path], object]
    growing: str = r"training\.safetensors|\.jsonl$"
    timed: str = r"$^"
    failure: int = REFUSED


def _run(writer: Writer, folder: Path, inputs: Path, mark: str, log: Path) -> None:
    """In a new process: write, with what is printed in a file, and end with a status."""
    status = 0
    try:
        os.setsid()
        os.environ[MARK] = mark
        descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        said = writer.write(folder, inputs)
        status = said if isinstance(said, int) else 0
    except (ValueError, OSError) as error:
        os.write(2, f"refused: {error}\n".encode())
        status = REFUSED
    except BaseException:
        os.write(2, traceback.format_exc().encode())
        status = BROKEN
    finally:
        os._exit(status)


@dataclasses.dataclass
class Run:
    """A run that has been started."""

    pid: int
    mark: str
    log: Path

    def said(self) -> str:
        """What it printed."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def status(self) -> int:
        """Its exit status, when it has ended; negative for a signal."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def killed_after(self, seconds: float) -> int:
        """Its exit status, after it was killed unless it had ended before."""
        time.sleep(seconds)
        os.kill(self.pid, signal.SIGKILL)
        return self.status()

    def survivors(self) -> list[int]:
        """The processes that it started and that still run after some patience; they are killed."""
        end = time.monotonic() + PATIENCE
        while (found := list(_marked(self.pid, self.mark))) and time.monotonic() < end:
            time.sleep(0.1)
        for pid in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return found


def _marked(group: int, mark: str) -> Iterator[int]:
    """Living processes of a group, and those that bear a mark in their environment."""
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state = (entry / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            marked = f"{MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0")
            if state[0] not in "ZX" and (marked or int(state[2]) == group):
                yield int(entry.name)


def started(
    writer: Writer, folder: Path, inputs: Path, before: Callable[[], object] = lambda: None, log: Path | None = None
) -> Run:
    """Start a run in a process of its own; ``before`` is called there first, ``log`` takes what it prints."""
    mark, log = uuid.uuid4().hex, log or folder.with_suffix(".log")
    pid = os.fork()
    if pid == 0:
        log.touch()
        before()
        _run(writer, folder, inputs, mark, log)
    return Run(pid, mark, log)


def plain(value: object) -> object:
    """JSON without what differs between two runs."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items() if not VARYING.search(key)}
    return [plain(inner) for inner in value] if isinstance(value, list) else value


def content(path: Path) -> object:
    """What a file holds, so that two runs can be compared; ValueError if it is not whole."""
    data = path.read_bytes()
    try:
        if path.suffix == ".gz":
            return gzip.decompress(data)
        if path.suffix in (".json", ".ipynb"):
            return plain(json.loads(data))
        if path.suffix == ".jsonl":
            text = data.decode()  # a last line may be cut short: whoever reads it leaves it out
            return [plain(json.loads(line)) for line in text[: text.rfind("\n") + 1].splitlines()]
        if path.suffix == ".safetensors":
            with safe_open(path, "numpy") as file:
                return {name: file.get_tensor(name).tobytes() for name in file.keys()}  # noqa: SIM118
    except (EOFError, OSError, UnicodeDecodeError) as error:
        raise ValueError(str(error)) from error
    except Exception as error:
        if type(error).__name__ == "SafetensorError":
            raise ValueError(str(error)) from error
        raise
    return data


def visible(folder: Path) -> dict[str, Path]:
    """The files of a folder, without temporary ones."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path for name, path in found.items() if ".writing-" not in name}


def half_written(writer: Writer, folder: Path, whole: Path) -> list[str]:
    """What is wrong with the files that a kill has left."""
    troubles, expected = [], visible(whole)
    for name, path in visible(folder).items():
        try:
            found = content(path)
        except ValueError as error:
            troubles.append(f"{name} can not be read: {error}")
            continue
        if re.search(writer.growing, name) or re.search(writer.timed, name):
            continue
        if name not in expected:
            troubles.append(f"{name} is there, which no whole run leaves")
        elif found != content(expected[name]):
            troubles.append(f"{name} is not what a whole run writes")
    return troubles


def unlike(writer: Writer, folder: Path, whole: Path) -> list[str]:
    """What is wrong with a folder that should be whole."""
    troubles = half_written(writer, folder, whole)
    troubles += [f"{name} is missing" for name in visible(whole).keys() - visible(folder).keys()]
    return troubles + [f"{path.name} was left" for path in folder.parent.rglob(".writing-*")]


def whole_run(writer: Writer, folder: Path, inputs: Path) -> float:
    """Run once without a kill; the seconds it took.

    Raises
    ------
    RuntimeError
        If it failed, with what it printed.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    run = started(writer, folder, inputs)
    if status := run.status():
        raise RuntimeError(f"{writer.name} ended with status {status}:\n{run.said()}")
    return time.monotonic() - began


def kill_trial(writer: Writer, place: Path, inputs: Path, whole: Path, seconds: float) -> list[str]:
    """Start, kill after some seconds, look, start again, look again; what was wrong."""
    folder = place / "out"
    place.mkdir(parents=True)
    run = started(writer, folder, inputs)
    status = run.killed_after(seconds)
    troubles = [f"process {pid} outlived its parent" for pid in run.survivors()]
    if status not in (0, -signal.SIGKILL):
        troubles.append(f"status {status} before the kill")
    if folder.exists():
        troubles += half_written(writer, folder, whole)
    try:
        whole_run(writer, folder, inputs)
    except RuntimeError as error:
        return [*troubles, f"the second start: {error}"]
    return troubles + unlike(writer, folder, whole)


def two_at_once(writer: Writer, place: Path, inputs: Path, whole: Path) -> list[str]:
    """Two runs on one folder: each ends well or refuses, and the folder is whole."""
    place.mkdir(parents=True)
    runs = [started(writer, place / "out", inputs) for _ in range(2)]
    statuses = sorted(run.status() for run in runs)
    said = runs[0].said()  # both write to one file
    if statuses not in ([0, 0], [0, REFUSED], [0, writer.failure]) or "Traceback" in said:
        return [f"two at once ended with {statuses}:\n{said}"]
    return unlike(writer, place / "out", whole)


def refusal(
    writer: Writer, place: Path, inputs: Path, log: Path, before: Callable[[], object], expected: str,
    wanted: int = REFUSED,
) -> list[str]:  # fmt: skip
    """What is wrong with a run that cannot write, and should say why."""
    run = started(writer, place / "out", inputs, before, log)
    status = run.status()
    if status != wanted or not re.search(expected, run.said()):
        return [f"status {status}, and it said: {run.said() or 'nothing'}"]
    return []


def bound_by_permissions() -> None:
    """Let root respect the rights of files, in this process."""
    if os.geteuid() == 0:
        header = (ctypes.c_uint32 * 2)(_CAP_VERSION, 0)
        ctypes.CDLL(None).capset(header, (ctypes.c_uint32 * 6)())


def bound_in_size(n_bytes: int) -> None:
    """Let no file of this process grow beyond a size: the write fails, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))


@contextlib.contextmanager
def small_disk(n_bytes: int) -> Iterator[Path | None]:
    """A disk of some bytes, or None where this user may not mount one."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["mount", "-t", "tmpfs", "-o", f"size={n_bytes}", "tmpfs", folder]
        with contextlib.suppress(OSError):
            if subprocess.run(words, capture_output=True, check=False).returncode == 0:
                try:
                    yield Path(folder)
                finally:
                    subprocess.run(["umount", "-l", folder], check=False)
                return
        yield None


def trials(writer: Writer, inputs: Path, n_kills: int, seed: int = 0) -> Iterator[str]:
    """Everything that is wrong with a writer, in sentences."""
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        whole = place / "whole" / "out"
        seconds = whole_run(writer, whole, inputs)
        yield from unlike(writer, whole, whole)
        moments = np.random.default_rng(seed).uniform(0, 1.05 * seconds, n_kills)
        for number, moment in enumerate(moments):
            for trouble in kill_trial(writer, place / f"kill{number}" / "a", inputs, whole, float(moment)):
                yield f"killed after {moment:.2f} of {seconds:.2f} s: {trouble}"
        yield from two_at_once(writer, place / "two" / "a", inputs, whole)
        yield from read_only(writer, place / "read-only" / "a", inputs)
        yield from full(writer, place, inputs, whole)


def read_only(writer: Writer, place: Path, inputs: Path) -> list[str]:
    """A folder that can not be written to."""
    place.mkdir(parents=True)
    place.chmod(0o555)
    try:
        return refusal(writer, place, inputs, place.parent / "log", bound_by_permissions, re.escape(str(place)))
    finally:
        place.chmod(0o755)


def full(writer: Writer, place: Path, inputs: Path, whole: Path) -> list[str]:
    """A disk on which not all of it has room, or files that may not grow."""
    sizes = [path.stat().st_size for path in visible(whole).values()]
    with small_disk(max(sum(sizes) // 2, 4096) // 4096 * 4096) as disk:
        if disk is None:
            folder, before = place / "full", lambda: bound_in_size(max(sizes) // 2)
            expected = "File too large|written"
        else:
            folder, before, expected = disk / "a", lambda: None, "is full; make room"
        folder.mkdir()
        troubles = refusal(writer, folder, inputs, place / "full.log", before, expected, writer.failure)
        if (folder / "out").exists():
            troubles += half_written(writer, folder / "out", whole)
        troubles += [f"{path.name} was left" for path in folder.rglob(".writing-*")]
        return [f"no room: {trouble}" for trouble in troubles]
