"""Time of a reconstruction by stage, and of the flow alone: ``python benchmarks/reconstruction.py``.

CPU seconds of this process and wall-clock seconds, medians of three, written to
``experiments/cost/reconstruction.json``. Targets on two idle cores: 60 s of wall-clock time for the MNI152 average; 5 s
for the flow alone with 40 962 vertices, 10 steps and the whole standard grid.
"""

import argparse
import sys
import time
from pathlib import Path

import torch
from ruler import medians, timed

from meshot.anatomy import fsaverage5_surface, mni152_t1
from meshot.mesh import Mesh
from meshot.model import N_STEPS
from meshot.pipeline import load_networks, reconstruct
from meshot.provenance import write_results
from meshot.synth import loop_subdivided
from meshot.systems import deformed, get_system, read_settings
from meshot.volume import standard_scan
from meshot_book.notebook import table

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "experiments" / "cost" / "reconstruction.json"
SCAN_LIMIT_S, FLOW_LIMIT_S = 60.0, 5.0
WHOLE, FLOW = "a scan, from volume to surfaces", "flow alone, {}"


def carried_surface() -> Mesh:
    """The left white surface of fsaverage5, refined once, with 40 962 vertices."""
    return loop_subdivided(fsaverage5_surface("white", "left"))


def flow(settings: str) -> dict:
    """The time of the flow of one network in the MNI152 average."""
    kind = get_system("ddot")
    network = read_settings(kind, settings).new_network()
    # An untrained network gives no motion. Random weights give motions of a millimetre or more, as a trained one does.
    torch.nn.init.normal_(network.to_velocity.weight, std=0.3, generator=torch.Generator().manual_seed(0))
    surface = carried_surface()
    image = standard_scan(mni152_t1(), mni152_t1()).volume
    return timed(FLOW.format(settings), lambda: deformed(surface, image, network))


def whole(initial_only: bool) -> list[dict]:
    """The time of every stage of a reconstruction of the MNI152 average with the package's networks, and the total."""
    networks = load_networks(initial_only=initial_only)
    found = reconstruct(mni152_t1(), networks.segmentation, networks.system)
    stages = [
        {"part": name, "CPU s": found.cpu_seconds[name], "wall s": found.wall_seconds[name]}
        for name in found.cpu_seconds
    ]
    return [*stages, {"part": WHOLE} | {key: sum(stage[key] for stage in stages) for key in ("CPU s", "wall s")}]


def main(words: list[str] | None = None) -> int:
    """Measure, print and store the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--initial-only", action="store_true", help="without the flow")
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    chosen = parser.parse_args(words)
    torch.set_num_threads(chosen.threads)
    started = time.perf_counter()
    rows = medians(
        [
            [*whole(chosen.initial_only), *(flow(settings) for settings in ("small", "paper"))]
            for _ in range(chosen.repeats)
        ]
    )
    print(f"{chosen.threads} threads\n{table(rows, 3)}")
    clock = {row["part"]: row["wall s"] for row in rows}
    limits = {WHOLE: SCAN_LIMIT_S, FLOW.format("small"): FLOW_LIMIT_S, FLOW.format("paper"): FLOW_LIMIT_S}
    targets = [
        {"what": part, "found_s": clock[part], "limit_s": limit, "met": clock[part] <= limit}
        for part, limit in limits.items()
    ]
    config = {key: value for key, value in vars(chosen).items() if key != "output"}
    config |= {"flow_vertices": len(carried_surface().vertices), "flow_steps": N_STEPS}
    data, seconds = "MNI152 average, fsaverage5", time.perf_counter() - started
    command = "python benchmarks/reconstruction.py" + (" --initial-only" if chosen.initial_only else "")
    write_results(chosen.output, {"parts": rows, "targets": targets}, config, command, data, seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
