"""Timing of the compared methods, and their peak memory in separate processes."""

import ctypes
import gc
import json
import math
import statistics
import subprocess
import sys
import time
from pathlib import Path

import peers

SCRIPT = Path(__file__).with_name("losses.py")


def timed(call: peers.Call) -> float:
    """Seconds of one call, or of the part of it that the call itself measures."""
    started = time.perf_counter()
    own = call()
    return own if isinstance(own, float) else time.perf_counter() - started


def support_count(name: str, m: int, config: dict) -> int:
    """The number of support points (faces for a continuous measure) of a method on each side at size ``m``."""
    return config["faces"][m] if name in (peers.EXACT, peers.VALUE) else m


def foretold_seconds(name: str, m: int, past: list[dict]) -> float:
    """A prediction from the last two sizes of a method: zero at first, then growth at least proportional to size."""
    own = [row for row in past if row["peer"] == name]
    if not own:
        return 0.0
    exponent = 1.0
    a, b = own[max(-2, -len(own))], own[-1]
    if a["m"] < b["m"]:  # two sizes may have the same number of faces
        exponent = max(1.0, math.log(b["seconds"] / a["seconds"]) / math.log(b["m"] / a["m"]))
    return own[-1]["seconds"] * (m / own[-1]["m"]) ** exponent


def reason_to_stop(name: str, m: int, past: list[dict], config: dict) -> str:
    """Why a method is not run at size ``m``; empty if it is."""
    peer = peers.PEERS[name]
    memory = peer.bytes_per_pair * m * m + peer.bytes_per_support * m
    if memory > config["largest_memory"]:
        return f"memory: at least {memory / 1e9:.3g} GB foretold"
    seconds = foretold_seconds(name, m, past)
    return f"time: {seconds:.3g} s foretold" if seconds > config["longest"] else ""


def measured_time(name: str, m: int, d: int, config: dict) -> dict:
    """Median seconds of a method in a loop of its own after a warm-up, or the reason why it failed.

    If the methods took turns, each would find caches, memory and threads in the state left by another. This slows the
    fast methods most and does not happen when one loss is called repeatedly.
    """
    size = support_count(name, m, config)
    try:
        times = warm_times(name, size, d, config)
    except Exception as error:  # the failure of a method is recorded; the benchmark continues
        return {"peer": name, "d": d, "m": m, "why": f"{type(error).__name__}: {str(error)[:200]}"}
    row = {"peer": name, "d": d, "m": size, "rounds": len(times)}
    return row | {"seconds": statistics.median(times), "low": min(times), "high": max(times)}


def warm_times(name: str, size: int, d: int, config: dict) -> list[float]:
    """Seconds of consecutive calls of a method, without the first one unless it is slow."""
    compile_for(name, d, config["n_directions"])
    call = peers.PEERS[name].make(size, d, config["n_directions"], config["seed"])
    first = timed(call)
    slow = first > config["slow"]
    if slow and not peers.PEERS[name].compiles:  # a slow method needs no warm-up
        return [first]
    return [timed(call) for _ in range(1 if slow else config["n_rounds"])]


def compile_for(name: str, d: int, n_directions: int) -> None:
    """Run a method on small inputs, so that compilation is finished before the measurement."""
    small = 1280 if name in (peers.EXACT, peers.VALUE) else 300
    peers.PEERS[name].make(small, d, n_directions, 0)()


def measured_memory(name: str, m: int, d: int, config: dict) -> dict:
    """Peak memory of one call in addition to its inputs, in a new process."""
    size = support_count(name, m, config)
    command = [sys.executable, str(SCRIPT), "--memory", name, "--size", str(size), "--dimension", str(d)]
    command += ["--directions", str(config["n_directions"]), "--threads", str(config["n_threads"])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=40 * config["longest"], check=False)
    if done.returncode:
        return {"peer": name, "d": d, "m": size, "why": f"the process ended with {done.returncode}"}
    return {"peer": name, "d": d, "m": size, "bytes": json.loads(done.stdout.splitlines()[-1])}


def print_memory(name: str, m: int, d: int, n_directions: int) -> None:
    """The code that :func:`measured_memory` runs in the new process: compile on small inputs, then measure."""
    compile_for(name, d, n_directions)
    call = peers.PEERS[name].make(m, d, n_directions, 0)
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)  # otherwise the call may reuse memory freed while making the inputs
    Path("/proc/self/clear_refs").write_text("5")  # reset the peak
    before = _status("VmRSS")
    call()
    print(max(0, _status("VmHWM") - before))


def _status(field: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return 1024 * int(line.split()[1])
    raise OSError(f"/proc/self/status has no {field}: memory is measured on Linux only")
