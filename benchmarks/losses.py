"""Time and memory of the losses: ours, POT, GeomLoss, OTT, and Chamfer by brute force and by a k-d tree.

Run on an otherwise idle machine, after ``make benchmark`` has installed the libraries that only benchmarks need::

    python benchmarks/losses.py            # about 20 minutes; a stopped run is resumed
    python benchmarks/losses.py --quick    # small sizes, one round, nothing written

Prints a table and writes ``experiments/cost/results.json``. The inputs are weighted measures on folded surfaces: points
in R³, and points with normals in R⁶. Value and gradient are computed in float64 on two threads, with the same
directions for all. Every method runs in its own loop after a warm-up; the results are medians. A method is not run at
sizes at which it would need too much time or memory.
"""

import argparse
import hashlib
import json
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import peers
import summary
import timing
import torch
import yaml
from tqdm import tqdm

from meshot.provenance import package_version, write_results
from meshot_book.notebook import table

FOLDER = Path(__file__).resolve().parent.parent / "experiments" / "cost"
PARTIAL = FOLDER / "partial.jsonl"
#: These settings decide which cases run. With a higher ceiling, only the cases that were left out are run.
CEILINGS = ("longest", "largest_memory")
QUICK = {"sizes": [1000, 3000, 10_000], "memory_sizes": [10_000], "n_rounds": 1, "longest": 3.0}


def run(config: dict, partial: Path | None) -> dict:
    """Run all missing cases. Finished cases are stored in ``partial``."""
    once = _Kept(config, partial)
    missing = peers.prepare()
    stopped = [{"peer": p, "why": why} for p, why in missing.items()]
    results = {"cases": [], "memory": [], "not weighed": [], "stopped": stopped}
    pairs = [(d, m) for d in config["dimensions"] for m in config["sizes"]]
    with tqdm(pairs, unit="size") as progress:
        for d, m in progress:
            case = f"d = {d}, m = {m}"
            names, timed = _able(m, d, results, missing, config), []
            for name in tqdm(names, desc=case, leave=False):
                row = once(f"time {d} {m} {name}", lambda n=name, m=m, d=d: timing.measured_time(n, m, d, config))
                results["stopped" if "why" in row else "cases"].append(row)
                timed += [] if "why" in row or name == peers.FLOOR else [name]
            for name in tqdm(timed if m in config["memory_sizes"] else [], desc=f"{case}: memory", leave=False):
                row = once(f"memory {d} {m} {name}", lambda n=name, m=m, d=d: timing.measured_memory(n, m, d, config))
                results["memory" if "bytes" in row else "not weighed"].append(row)
    results["seconds"] = once.seconds()
    return results


class _Kept:
    """Rows that are measured once and stored in a file, under a key with the settings that change a measurement."""

    def __init__(self, config: dict, partial: Path | None) -> None:
        lines = partial.read_text(encoding="utf-8").splitlines() if partial and partial.exists() else []
        self.done = {line["key"]: line for line in map(json.loads, lines)}
        self.partial = partial
        measured = {name: value for name, value in config.items() if name not in CEILINGS}
        self.of_config = hashlib.sha256(json.dumps(measured, sort_keys=True).encode()).hexdigest()[:8]

    def __call__(self, key: str, work: Callable[[], dict]) -> dict:
        key = f"{self.of_config} {key}"
        if key not in self.done:
            started = time.perf_counter()
            self.done[key] = {"key": key, "row": work(), "seconds": time.perf_counter() - started}
            if self.partial:
                with self.partial.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(self.done[key]) + "\n")
        return self.done[key]["row"]

    def seconds(self) -> float:
        """Of all rows measured with these settings."""
        return sum(line["seconds"] for key, line in self.done.items() if key.startswith(self.of_config))


def _able(m: int, d: int, results: dict, missing: dict, config: dict) -> list[str]:
    """The methods that run at this size. A method that no longer runs is recorded once in ``missing``."""
    names, past = [], [row for row in results["cases"] if row["d"] == d]
    out = {row["peer"] for row in results["stopped"] if row.get("d", d) == d} | set(missing)
    for name in peers.PEERS:
        size = timing.support_count(name, m, config)
        if name in out or any(row["peer"] == name and row["m"] == size for row in past):
            continue
        why = timing.reason_to_stop(name, size, past, config)
        if why:
            results["stopped"].append({"peer": name, "d": d, "m": size, "why": why})
        else:
            names.append(name)
    return names


def printed(results: dict) -> str:
    """A table of the seconds of every method by size, and of the targets."""
    parts = []
    for d in sorted({row["d"] for row in results["cases"]}):
        by_peer: dict[str, dict] = {}
        for row in results["cases"]:
            if row["d"] == d:
                by_peer.setdefault(row["peer"], {"peer": row["peer"]})[str(row["m"])] = row["seconds"]
        sizes = sorted({int(size) for row in by_peer.values() for size in row if size != "peer"})
        rows = [{"peer": n} | {str(size): row.get(str(size), "") for size in sizes} for n, row in by_peer.items()]
        parts.append(f"seconds, d = {d}, by supports on each side\n{table(rows, 3)}")
    rows = [{k: "–" if v is None else v for k, v in row.items()} for row in results["targets"]]
    return "\n\n".join([*parts, f"{table(rows, 3)}", f"{table(results['stopped'])}"])


def main() -> None:
    """Run the benchmark, print the table, and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes, one round, nothing written")
    parser.add_argument("--rounds", type=int, help="in place of the configured number")
    parser.add_argument("--longest", type=float, help="seconds that a peer may take, in place of the configured ones")
    parser.add_argument("--memory", choices=list(peers.PEERS), help=argparse.SUPPRESS)
    for name in ("size", "dimension", "directions", "threads"):
        parser.add_argument(f"--{name}", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.memory:
        torch.set_num_threads(arguments.threads)
        peers.prepare()
        timing.print_memory(arguments.memory, arguments.size, arguments.dimension, arguments.directions)
        return
    config = yaml.safe_load((FOLDER / "config.yaml").read_text(encoding="utf-8"))
    config |= QUICK if arguments.quick else {}
    config |= {"n_rounds": arguments.rounds} if arguments.rounds else {}
    config |= {"longest": arguments.longest} if arguments.longest else {}
    torch.set_num_threads(config["n_threads"])
    results = run(config, None if arguments.quick else PARTIAL)
    results["exponents"] = summary.exponents(results["cases"], results["memory"])
    results["targets"] = summary.targets(results["cases"], results["memory"])
    seconds = results.pop("seconds")
    results["peers"] = {name: package_version(name) for name in ("ott-jax", "jax", "pykeops", "POT", "geomloss")}
    print(printed(results))
    if not arguments.quick:
        write = FOLDER / "results.json", results, config, "python benchmarks/losses.py"
        write_results(*write, "folded spheres, sampled", seconds)
        PARTIAL.unlink()


if __name__ == "__main__":
    main()
