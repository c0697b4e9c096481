"""What is kept of S1 shows no face, and measures spheres as it should."""

from pathlib import Path

import numpy as np
import pytest
import torch

from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot_book.figures.cortex import read_slices

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "shown_person"


def ball(radius: float, centre=(0.0, 0.0, 0.0)):
    mesh = icosphere(4, radius)
    return mesh.with_vertices(mesh.vertices.double() + torch.tensor(centre, dtype=torch.float64))


def test_what_is_far_from_the_cerebrum_is_black(run):
    affine = np.eye(4)
    affine[:3, 3] = -25
    scan = Volume(np.full((51, 51, 51), 9.0), affine)
    shown = run.defaced(scan, [ball(10.0, (-3, 0, 0)), ball(10.0, (3, 0, 0))], 4.0)
    places = np.indices(shown.data.shape).reshape(3, -1).T + shown.affine[:3, 3]
    away = np.minimum(*(np.linalg.norm(places - [x, 0, 0], axis=1) for x in (-3, 3))) - 10
    bright = shown.data.ravel() > 0
    diagonal = 3**0.5  # a voxel that the surface touches counts as inside
    assert bright[away < 4].all()
    assert not bright[away > 4 + diagonal].any()
    assert (~bright).any()


def test_spheres_are_described_exactly(run):
    mesh = ball(9.0)
    found = run.described(mesh, np.full(len(mesh.vertices), -1.0), 2)
    assert found["area_cm2"] == pytest.approx(4 * np.pi * 0.81, rel=0.01)
    assert found["volume_cm3"] == pytest.approx(4 / 3 * np.pi * 0.729, rel=0.01)
    assert found["signed_mm"]["mean"] == pytest.approx(-1)
    assert found["signed_mm"]["quantiles"]["0.5"] == -1
    assert found["share_beyond"]["0.5"] == pytest.approx(1)
    assert found["share_beyond"]["1"] == 0
    assert sum(found["shares_of_area"]) == pytest.approx(1)
    assert found["smoothed_area_cm2"] == pytest.approx(found["area_cm2"], rel=0.01)


def test_half_of_a_sphere_is_weighed_by_area(run):
    mesh = ball(9.0)
    upper = mesh.vertices[:, 2].numpy() > 0
    found = run.described(mesh, np.where(upper, 2.5, -0.5), 1)
    assert found["signed_mm"]["mean"] == pytest.approx(1, abs=0.05)
    assert found["share_beyond"]["2"] == pytest.approx(0.5, abs=0.02)


def test_a_place_counts_what_is_near_it(run):
    mesh = ball(9.0)
    signed = np.where(mesh.vertices[:, 2].numpy() > 0, -3.0, 5.0)
    place = {"name": "top", "at": [0, 0, 9], "radius_mm": 4.0}
    found = run.at_place(place, [mesh], [signed], 1.0)
    assert found["farthest_mm"] == -3
    assert found["area_mm2"] == pytest.approx(np.pi * 16, rel=0.1)  # a cap of chord 4 has the area of the disc
    assert run.at_place(place, [mesh], [signed], 4.0)["area_mm2"] == 0


def test_the_slices_are_black_around_the_brain():
    for each in read_slices(FOLDER / "slices.safetensors.gz"):
        rows, columns = np.nonzero(each.image)
        left, right, bottom, top = each.extent
        height, width = each.image.shape
        points = np.stack(
            [left + (columns + 0.5) * (right - left) / width, bottom + (rows + 0.5) * (top - bottom) / height], 1
        )
        lines = np.concatenate([*each.found, *each.reference])
        gaps = np.array([np.linalg.norm(lines - point, axis=1).min() for point in points[::37]])
        # The cortex is up to 5 mm thick, and what is shown ends 4 mm outside it.
        low, high = lines.min(axis=0) - 22, lines.max(axis=0) + 22  # the tip of a temporal lobe has no white matter
        assert ((points > low) & (points < high)).all()
        assert np.mean(gaps < 12) > 0.8


def test_the_eyes_and_the_nose_are_black():
    """Below the frontal lobes, and in front of the temporal ones; the eyes of S1 are near (±30, 90, −30)."""
    seen = set()
    for each in read_slices(FOLDER / "slices.safetensors.gz"):
        left, right, bottom, top = each.extent
        height, width = each.image.shape
        across = left + (np.arange(width) + 0.5) * (right - left) / width
        along = bottom + (np.arange(height) + 0.5) * (top - bottom) / height
        if each.plane == "coronal" and each.position > 75:
            assert each.image[along < -27].max(initial=0) == 0
            seen.add("coronal")
        if each.plane == "axial" and each.position < -10:
            assert each.image[along > 80][:, np.abs(across) > 25].max() == 0
            assert each.image[along > 112].max(initial=0) == 0
            seen.add("axial")
    assert seen == {"coronal", "axial"}


def test_the_licence_of_the_scan_is_kept():
    assert "Regents of the University of California" in (FOLDER / "LICENSE").read_text(encoding="utf-8")
