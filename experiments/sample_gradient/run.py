"""Gradients through samples: the bias of fixed draws, and what it does to a descent.

Run as ``python experiments/sample_gradient/run.py``. Finished parts are kept in ``partial.json`` until all are done, so
that a run that was stopped goes on with the next part.
"""

import json
import time
from pathlib import Path

import torch
import yaml
from bias import curve, losses
from fitting import descents
from tqdm import tqdm

from meshot.files import whole_file
from meshot.provenance import write_results

HERE = Path(__file__).parent
PARTS = {"curve": curve, "losses": losses, "descent": descents}


def main() -> None:
    """Do the parts that are missing, then write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.json"
    done = json.loads(partial.read_text(encoding="utf-8")) if partial.exists() else {}
    for name, part in tqdm(PARTS.items(), unit="part"):
        if name in done:
            continue
        started = time.perf_counter()
        found = part(config)
        done[name] = {"found": found, "seconds": time.perf_counter() - started}
        with whole_file(partial) as temporary:
            temporary.write_text(json.dumps(done), encoding="utf-8")
    results = {name: part["found"] for name, part in done.items()}
    seconds = sum(part["seconds"] for part in done.values())
    command = "python experiments/sample_gradient/run.py"
    write_results(HERE / "results.json", results, config, command, "synthetic contours and surfaces", seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
