"""Make the initial surfaces of all scans of cohorts, so that trainings and evaluations find them.

Run as ``python workflow/initial_surfaces.py COHORT... --into FOLDER``. What is there already is not made again.
"""

import argparse
import sys
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES
from meshot.model import SegmentationNetwork, read_weights
from meshot.pipeline import InitialSurfaces, segmentation_weights
from meshot.synth import scans


def main(words: list[str] | None = None) -> int:
    """Make the missing surfaces, on one thread."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cohorts", nargs="+", type=Path)
    parser.add_argument("--into", type=Path, required=True, help="the folder of the initial surfaces")
    parser.add_argument("--segmentation", help="weights of the segmentation network (default: those of the package)")
    asked = parser.parse_args(words)
    torch.set_num_threads(1)
    network = read_weights(segmentation_weights(asked.segmentation), SegmentationNetwork)[0]
    surfaces = InitialSurfaces(asked.into, network)
    for subject in tqdm([each for cohort in asked.cohorts for each in scans(cohort)], desc="initial surfaces"):
        for side in HEMISPHERES:
            surfaces.of(subject, side)
    return 0


if __name__ == "__main__":
    sys.exit(main())
