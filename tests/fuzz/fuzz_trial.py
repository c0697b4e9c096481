"""Damaged files read in a process of its own, with limits on memory and time; only clear refusals pass."""

import contextlib
import io
import multiprocessing
import resource
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from fuzz_mutations import damaged
from fuzz_seeds import KINDS, whole

SECONDS, BYTES = 2.0, 1 << 30  # of processor time, and beyond what the process holds before
PATIENCE = 60.0  # by the clock: a machine may be busy


def content_of(number: int) -> tuple[str, bytes]:
    """The name and the content of one damaged file; the number is the seed."""
    random = np.random.default_rng([number, 20])
    name = list(KINDS)[number % len(KINDS)]
    return name, damaged(whole(name), random)


def verdict(number: int, folder: Path) -> str:
    """Empty if the file was read or refused as it should be; else what happened."""
    name, content = content_of(number)
    path = folder / name
    path.write_bytes(content)
    began = time.process_time()
    try:
        with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
            warnings.simplefilter("ignore")
            KINDS[name][1](path)
    except (ValueError, OSError) as error:
        chain = error
        while chain is not None:
            if isinstance(chain, MemoryError):
                return f"{name}: more than 1 GiB wanted: {error}"
            chain = chain.__cause__ or chain.__context__
    except BaseException:
        return f"{name}: {traceback.format_exc(limit=-3)}"
    finally:
        path.unlink()
    seconds = time.process_time() - began
    return f"{name}: {seconds:.1f} s" if seconds > SECONDS else ""


def _work(connection: Connection) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name in KINDS:  # whatever is loaded or compiled only once
            (Path(folder) / name).write_bytes(whole(name))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with contextlib.suppress(ValueError):
                    KINDS[name][1](Path(folder) / name)
        pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
        limit = pages * resource.getpagesize() + BYTES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        connection.send("ready")
        while True:
            connection.send(verdict(connection.recv(), Path(folder)))


def trials(numbers: range) -> Iterator[tuple[int, str]]:
    """The number of each file that was not refused as it should be, and what happened.

    A process that hangs or dies is replaced.
    """
    worker, connection = None, None
    for number in numbers:
        if worker is None:
            worker, connection = _started()
        try:
            connection.send(number)
            said = connection.recv() if connection.poll(PATIENCE) else f"{content_of(number)[0]}: hangs"
        except (EOFError, OSError):
            said = f"{content_of(number)[0]}: the process died"
        if said:
            yield number, said
        if said.endswith(("hangs", "died")):
            worker.kill()
            worker = None
    if worker is not None:
        worker.kill()


def _started() -> tuple[multiprocessing.Process, Connection]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    worker = context.Process(target=_work, args=(theirs,), daemon=True)
    worker.start()
    theirs.close()
    assert ours.recv() == "ready"
    return worker, ours
