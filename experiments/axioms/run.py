"""Test the axioms of a distance on every loss, and look for the worst counterexample.

Run as ``python experiments/axioms/run.py``. Finished searches are kept in ``partial.json`` until all are done.
"""

import json
import time
from pathlib import Path

import torch
import yaml
from ghosts import measured
from sequences import KINDS, followed
from tqdm import tqdm
from triangles import search

from meshot.provenance import write_results

HERE = Path(__file__).parent


def main() -> None:
    """Search for broken triangles, then measure ghosts and sequences."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.json"
    done = json.loads(partial.read_text(encoding="utf-8")) if partial.exists() else {}
    for name, setting in tqdm(config["losses"].items()):
        if name not in done:
            done[name] = search(name, setting, config)
            partial.write_text(json.dumps(done), encoding="utf-8")
    ghosts = [
        measured(n, d, config["seed"]) for d in config["ghosts"]["dimensions"] for n in config["ghosts"]["n_directions"]
    ]
    rooted = {name: setting for name, setting in config["losses"].items() if setting["root"]}
    sequences = [followed(kind, name, setting, config) for kind in KINDS for name, setting in rooted.items()]
    results = {"triangles": [done[name] for name in config["losses"]], "ghosts": ghosts, "sequences": sequences}
    seconds = time.perf_counter() - started
    command, data = "python experiments/axioms/run.py", "drawn and constructed point measures"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
