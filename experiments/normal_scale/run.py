"""The share of the normals in the sliced loss of oriented varifolds, over their scale in mm.

Run as ``python experiments/normal_scale/run.py``. Finished pairs are kept in ``partial.json`` until all are done, so
that a run that was stopped goes on with the next pair.
"""

import json
import time
from pathlib import Path

import torch
import yaml
from shares import crossing_scale, measure_pair, pairs
from tqdm import tqdm

from meshot.files import whole_file
from meshot.provenance import write_results

HERE = Path(__file__).parent


def main() -> None:
    """Do the pairs that are missing, then write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.json"
    done = json.loads(partial.read_text(encoding="utf-8")) if partial.exists() else {}
    for name, pair in tqdm(pairs(config).items(), unit="pair"):
        if name in done:
            continue
        started = time.perf_counter()
        found = measure_pair(*pair, config)
        done[name] = {"found": found, "seconds": time.perf_counter() - started}
        with whole_file(partial) as temporary:
            temporary.write_text(json.dumps(done), encoding="utf-8")
    found = [
        {"pair": name, "half_of_loss_at": crossing_scale(row["found"]["rows"]), **row["found"]}
        for name, row in done.items()
    ]
    seconds = sum(row["seconds"] for row in done.values())
    command = "python experiments/normal_scale/run.py"
    data = "the white and pial surfaces of fsaverage5; synthetic folded surfaces"
    write_results(HERE / "results.json", {"pairs": found}, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
