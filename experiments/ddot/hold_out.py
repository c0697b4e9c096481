"""Make the small file of one held-out hemisphere that chapter 18 uses: ``held_out.safetensors``.

Run as ``python experiments/ddot/hold_out.py`` when the cohort and the segmentation weights exist. The subject is the
first of the test split, so that it is not selected by results.
"""

import dataclasses
import sys
from pathlib import Path

from meshot.mesh import smooth_crossings
from meshot.model import network_digest
from meshot.pipeline import InitialSurfaces
from meshot.provenance import provenance
from meshot.synth import scans
from meshot.systems import hemisphere_example
from meshot_book.example_file import write_example

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.training import arguments, read_config, segmentation_network

COHORT, SIDE = "oasis_like", "left"
INITIAL_FACES, TARGET_FACES = 30_000, 30_000


def main(words: list[str] | None = None) -> int:
    """Write the file."""
    asked = arguments(__doc__, Path(__file__).parent, "held_out.safetensors").parse_args(words)
    config = read_config(asked.config)
    network = segmentation_network(config)
    subject = scans(config["cohorts"][COHORT], config["evaluation"]["split"])[0]
    keys = [(SIDE, "white")]
    example = InitialSurfaces(config["initial"], network).example(subject, keys, keys)
    example = hemisphere_example(example, SIDE, INITIAL_FACES)
    # Simplification may cause self-intersections, which the initial surface of a flow must not have.
    example = dataclasses.replace(example, initial=smooth_crossings(example.coarse))
    record = provenance() | {"cohort": COHORT, "side": SIDE, "segmentation_sha256": network_digest(network)}
    write_example(asked.output, example, record, TARGET_FACES)
    return 0


if __name__ == "__main__":
    sys.exit(main())
