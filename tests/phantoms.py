"""Two bumpy balls for hemispheres in a noisy image: the least that looks like a scan to a network."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh.editing import laplacian_smoothing, simplified
from meshot.mesh.geometry import vertex_normals
from meshot.mesh.io import write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.pipeline.segmentation import Example as SegmentationExample, example
from meshot.systems.flows import DeformationExample
from meshot.systems.protocol import Example, Scan, SurfaceKey
from meshot.volume.io import write_volume
from meshot.volume.registration import StandardScan
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume

SHAPE, SIZES = (32, 24, 24), np.array([1.5, 208 / 144, 1.5])
AFFINE = np.diag([*SIZES, 1.0])
AFFINE[:3, 3] = -SIZES * (np.array(SHAPE) - 1) / 2


def phantom_surfaces(seed: int, depth: float = 1.0) -> dict[str, Mesh]:
    """A left and a right surface with folds ``depth`` mm deep, around x = ∓10 mm."""
    random, surfaces = np.random.default_rng(seed), {}
    for side, x in (("left", -10.0), ("right", 10.0)):
        ball = icosphere(4, 8.0)
        wave = ball.vertices.new_tensor(random.normal(scale=0.6, size=(3, 3)))
        height = depth * (ball.vertices @ wave).sin().sum(dim=1, keepdim=True) / 3
        centre = ball.vertices.new_tensor([x, *random.uniform(-2, 2, 2)])
        surfaces[side] = ball.with_vertices(ball.vertices * (1 + height / 8) + centre)
    return surfaces


def pial_surfaces(surfaces: dict[str, Mesh]) -> dict[str, Mesh]:
    """A surface 1 mm outside of each white one, along its normals."""
    return {side: mesh.with_vertices(mesh.vertices + vertex_normals(mesh)) for side, mesh in surfaces.items()}


def phantom_scan(surfaces: dict[str, Mesh], seed: int) -> StandardScan:
    """Bright inside, grey around, noise on top, in [0, 1]."""
    grid = Volume(np.zeros(SHAPE), AFFINE)
    inside = sum(enclosed_fractions(mesh, grid) for mesh in surfaces.values())
    image = 0.4 + 0.4 * inside + 0.05 * np.random.default_rng(seed).standard_normal(SHAPE)
    return StandardScan(grid.with_data(np.clip(image, 0, 1)), np.eye(4))


def phantom_examples(n: int, seed: int = 0, reduction: int = 1) -> list[SegmentationExample]:
    """Several, each of its own shape and noise."""
    made = [(f"phantom-{i}", phantom_surfaces(seed + i), seed + i) for i in range(n)]
    return [example(name, phantom_scan(white, s).volume, white, reduction) for name, white, s in made]


def phantom_deformations(n: int, seed: int = 0, side: str = "left") -> list[DeformationExample]:
    """Several hemispheres to be deformed: each begins as itself without its folds, half a millimetre too small."""
    found = []
    for i in range(seed, seed + n):
        white = phantom_surfaces(i)
        target, scan = white[side], phantom_scan(white, i).volume
        smooth = laplacian_smoothing(target, 10).vertices
        centre = smooth.mean(dim=0)
        initial = target.with_vertices(centre + 0.94 * (smooth - centre)).to(torch.float32)
        scan = scan.with_data(scan.data.astype(np.float32))
        coarse = simplified(initial, 1000)
        found.append(DeformationExample(f"phantom-{i}", scan, initial, coarse, target.to(torch.float32)))
    return found


def phantom_subjects(n: int, needs: Sequence[SurfaceKey], seed: int = 0, pial: bool = False) -> list[Example]:
    """The same as examples for any system: true surfaces of both sides, and the initial ones that it needs."""
    sides = {side: phantom_deformations(n, seed, side) for side in HEMISPHERES}
    outer = [pial_surfaces({side: found[i].target for side, found in sides.items()}) if pial else {} for i in range(n)]
    return [
        Example(
            f"phantom-{seed + i}",
            Scan(sides["left"][i].scan, {key: sides[key[0]][i].initial for key in needs}),
            {(side, "white"): found[i].target for side, found in sides.items()}
            | {(side, "pial"): mesh for side, mesh in outer[i].items()},
        )
        for i in range(n)
    ]


def write_phantom_cohort(folder: Path, splits: Sequence[str]) -> Path:
    """A cohort on disk, one phantom for each split named, laid out as meshot.synth.cohorts reads it."""
    rows = ["participant_id\tsplit\tkind\tseed"]
    for i, split in enumerate(splits):
        name = f"sub-{i + 1:03d}"
        rows.append(f"{name}\t{split}\ttemplate\t{i}")
        place, standard = folder / name / "anat", folder / "derivatives" / "standard" / name / "anat"
        surfaces = phantom_surfaces(i)
        scan = phantom_scan(surfaces, i)
        for part in (place, standard):
            part.mkdir(parents=True)
        write_volume(place / f"{name}_T1w.nii.gz", scan.volume)
        write_volume(standard / f"{name}_space-MNI152_desc-standard_T1w.nii.gz", scan.volume)
        (standard / f"{name}_from-T1w_to-MNI152_mode-image_xfm.json").write_text(
            json.dumps({"matrix": np.eye(4).tolist()})
        )
        for side, mesh in surfaces.items():
            write_mesh(place / f"{name}_hemi-{side[0].upper()}_white.surf.gii", mesh)
    (folder / "participants.tsv").write_text("\n".join(rows) + "\n")
    return folder
