"""Seconds side by side, and peak memory in a process of its own."""

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
from tqdm import tqdm

SCRIPT = Path(__file__).with_name("losses.py")


def timed(call: peers.Call) -> float:
    """Seconds of one call; of a part alone where the call says so itself."""
    started = time.perf_counter()
    own = call()
    return own if isinstance(own, float) else time.perf_counter() - started


def support_count(name: str, m: int, config: dict) -> int:
    """How many supports, or for a continuous measure faces, a peer gets on each side at size ``m``."""
    return config["faces"][m] if name in (peers.EXACT, peers.VALUE) else m


def foretold_seconds(name: str, m: int, past: list[dict]) -> float:
    """From the last two sizes of a peer; a first guess of zero, then growth at least in proportion."""
    own = [row for row in past if row["peer"] == name]
    if not own:
        return 0.0
    exponent = 1.0
    a, b = own[max(-2, -len(own))], own[-1]
    if a["m"] < b["m"]:  # two sizes may share a number of faces
        exponent = max(1.0, math.log(b["seconds"] / a["seconds"]) / math.log(b["m"] / a["m"]))
    return own[-1]["seconds"] * (m / own[-1]["m"]) ** exponent


def reason_to_stop(name: str, m: int, past: list[dict], config: dict) -> str:
    """Why a peer is not tried at size ``m``, or nothing."""
    peer = peers.PEERS[name]
    memory = peer.bytes_per_pair * m * m + peer.bytes_per_support * m
    if memory > config["largest_memory"]:
        return f"memory: at least {memory / 1e9:.3g} GB foretold"
    seconds = foretold_seconds(name, m, past)
    return f"time: {seconds:.3g} s foretold" if seconds > config["longest"] else ""


def compare(m: int, d: int, names: list[str], config: dict) -> tuple[list[dict], list[dict]]:
    """Median seconds of every peer in a warm loop of its own, and who failed.

    In turns each would find the caches, the memory and the threads as another has left them, which costs the fast ones
    most: nobody who calls a loss again and again meets that.
    """
    found, failed = [], []
    for name in tqdm(names, desc=f"d = {d}, m = {m}", leave=False):
        size = support_count(name, m, config)
        try:
            times = warm_times(name, size, d, config)
        except Exception as error:  # a peer that fails is a finding, not the end
            failed.append({"peer": name, "d": d, "m": m, "why": f"{type(error).__name__}: {str(error)[:200]}"})
            continue
        row = {"peer": name, "d": d, "m": size, "rounds": len(times)}
        found.append(row | {"seconds": statistics.median(times), "low": min(times), "high": max(times)})
    return found, failed


def warm_times(name: str, size: int, d: int, config: dict) -> list[float]:
    """Seconds of a peer's calls one after the other, the first left out unless it is so slow that it has to do."""
    compile_for(name, d, config["n_directions"])
    call = peers.PEERS[name].make(size, d, config["n_directions"], config["seed"])
    first = timed(call)
    slow = first > config["slow"]
    if slow and not peers.PEERS[name].compiles:  # what is slow has no use for warming up
        return [first]
    return [timed(call) for _ in range(1 if slow else config["n_rounds"])]


def compile_for(name: str, d: int, n_directions: int) -> None:
    """Run a peer on a few supports, so that what is compiled once is compiled before anything is measured."""
    small = 1280 if name in (peers.EXACT, peers.VALUE) else 300
    peers.PEERS[name].make(small, d, n_directions, 0)()


def measured_memory(name: str, m: int, d: int, config: dict) -> dict:
    """Peak memory of one call above its inputs, in a fresh process."""
    size = support_count(name, m, config)
    command = [sys.executable, str(SCRIPT), "--memory", name, "--size", str(size), "--dimension", str(d)]
    command += ["--directions", str(config["n_directions"]), "--threads", str(config["n_threads"])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=40 * config["longest"], check=False)
    if done.returncode:
        return {"peer": name, "d": d, "m": size, "why": f"the process ended with {done.returncode}"}
    return {"peer": name, "d": d, "m": size, "bytes": json.loads(done.stdout.splitlines()[-1])}


def print_memory(name: str, m: int, d: int, n_directions: int) -> None:
    """What :func:`measured_memory` asks the fresh process for: load and compile on few supports, then measure."""
    compile_for(name, d, n_directions)
    call = peers.PEERS[name].make(m, d, n_directions, 0)
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)  # else the call may live on what making the inputs has left behind
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins here
    before = _status("VmRSS")
    call()
    print(max(0, _status("VmHWM") - before))


def _status(field: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field):
            return 1024 * int(line.split()[1])
    raise OSError(f"/proc/self/status has no {field}: memory is measured on Linux only")
