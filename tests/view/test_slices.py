"""Slices and contours lie where the world says, whatever the orientation of the voxels."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backend_bases import MouseEvent
from matplotlib.collections import LineCollection

from meshot.mesh.shapes import icosphere
from meshot.view.slices import slice_figure, slice_image
from meshot.volume.volume import Volume
from refusals import refuses

CENTRE = np.array([-12.0, 7.0, 20.0])


def oblique_affine() -> np.ndarray:
    """Voxels of 1 × 1.5 × 2 mm, the first axis flipped, turned about an oblique axis."""
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(0.7) * cross + (1 - np.cos(0.7)) * cross @ cross
    affine = np.eye(4)
    affine[:3, :3] = turn @ np.diag([-1.0, 1.5, 2.0])
    affine[:3, 3] = CENTRE - affine[:3, :3] @ np.array([40.0, 26.0, 20.0])
    return affine


def linear_volume(slope: np.ndarray, affine: np.ndarray) -> Volume:
    """A volume whose value is a linear function of the place in mm: interpolation must give it back exactly."""
    places = np.indices((80, 52, 40)).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    return Volume((places @ slope).reshape(80, 52, 40), affine)


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_every_pixel_holds_the_value_of_its_place_in_mm(axis):
    slope = np.array([1.0, 100.0, 10_000.0])
    image, (left, right, bottom, top) = slice_image(linear_volume(slope, oblique_affine()), axis, CENTRE[axis] + 1.25)
    rows, columns = image.shape
    across, along = [i for i in range(3) if i != axis]
    places = np.empty((rows, columns, 3))
    places[..., axis] = CENTRE[axis] + 1.25
    places[..., across] = left + (right - left) * (np.arange(columns) + 0.5) / columns
    places[..., along] = (bottom + (top - bottom) * (np.arange(rows) + 0.5) / rows)[:, None]
    known = np.isfinite(image)
    assert 0.2 < known.mean() < 1
    np.testing.assert_allclose(image[known], (places @ slope)[known], rtol=1e-9, atol=1e-6)


def test_what_is_outside_the_volume_has_no_value():
    image, _ = slice_image(Volume(np.ones((4, 4, 4)), np.eye(4)), 2, 9.0)
    assert np.isnan(image).all()


def test_contours_of_a_sphere_are_circles_in_mm_and_bound_the_bright_ball():
    volume = linear_volume(np.zeros(3), oblique_affine())
    places = np.indices(volume.data.shape).reshape(3, -1).T @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    ball = 12 - np.linalg.norm(places - CENTRE, axis=1).reshape(volume.data.shape)
    sphere = icosphere(5, 12.0, tuple(CENTRE))
    through = CENTRE + np.array([3.0, 4.0, 5.0])
    figure = slice_figure(volume.with_data(ball), {"sphere": sphere}, through)
    panels = [ax for ax in figure.axes if ax.images]
    assert len(panels) == 3
    for ax, axis in zip(panels, (2, 1, 0)):
        shown = [i for i in range(3) if i != axis]
        (lines,) = (child for child in ax.get_children() if isinstance(child, LineCollection))
        ends = np.concatenate(lines.get_segments())
        radius = np.sqrt(12**2 - (through - CENTRE)[axis] ** 2)
        np.testing.assert_allclose(np.linalg.norm(ends - CENTRE[shown], axis=1), radius, atol=0.01)
        image = ax.images[0].get_array().filled(np.nan)
        left, right, bottom, top = ax.images[0].get_extent()
        area = (image > 0).sum() * (right - left) * (top - bottom) / image.size
        assert area == pytest.approx(np.pi * radius**2, rel=0.02)


def test_axes_say_mm_and_sides_and_the_legend_names_the_surfaces():
    volume = linear_volume(np.array([1.0, 0, 0]), oblique_affine())
    figure = slice_figure(
        volume, {"initial": icosphere(2, 9.0, tuple(CENTRE)), "fitted": icosphere(2, 8.0, tuple(CENTRE))}
    )
    axial, coronal, sagittal = (ax for ax in figure.axes if ax.images)
    assert (axial.get_xlabel(), axial.get_ylabel()) == ("x (mm)", "y (mm)")
    assert (sagittal.get_xlabel(), sagittal.get_ylabel()) == ("y (mm)", "")  # z as in the panel beside it
    assert (coronal.get_xlabel(), coronal.get_ylabel()) == ("", "z (mm)")  # x as in the panel below
    assert (coronal.get_xlim(), coronal.get_ylim()) == (axial.get_xlim(), sagittal.get_ylim())
    assert coronal.get_title() == "coronal\ny = 7.0 mm"
    assert sagittal.get_title() == "sagittal\nx = −12.0 mm"
    for ax in (axial, coronal):
        letters = {text.get_text(): text.get_position()[0] for text in ax.texts}
        assert letters["L"] < 0.5 < letters["R"]
        assert all(text.get_color() == "white" and text.get_path_effects() for text in ax.texts)  # seen on white too
        assert not ax.xaxis_inverted()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["initial", "fitted"]


def test_what_is_drawn_at_a_place_is_what_the_volume_has_there():
    slope = np.array([1.0, 100.0, 10_000.0])
    figure = slice_figure(linear_volume(slope, oblique_affine()), None, CENTRE)
    figure.draw_without_rendering()
    for ax, axis in zip(figure.axes, (2, 1, 0)):
        place = CENTRE + np.array([9.0, -8.0, 10.0])
        place[axis] = CENTRE[axis]
        x, y = ax.transData.transform(np.delete(place, axis))
        pointer = MouseEvent("motion_notify_event", figure.canvas, x, y)
        value = ax.images[0].get_cursor_data(pointer)
        # Half a pixel of the slice and one of the screen make less than 1.5 mm along each axis.
        assert abs(value - place @ slope) <= 1.5 * np.delete(slope, axis).sum()


@pytest.mark.parametrize("planes", [("axial", "coronal", "sagittal"), ("sagittal", "axial")])
def test_a_millimetre_is_equally_long_in_all_panels(planes):
    volume = Volume(np.zeros((30, 60, 90)), np.eye(4))
    figure = slice_figure(volume, planes=planes, limits=(0, 1))
    figure.draw_without_rendering()
    scales = [ax.get_window_extent().width / np.ptp(ax.get_xlim()) for ax in figure.axes]
    assert max(scales) / min(scales) < 1.05


def test_three_panels_stand_where_they_share_an_axis_with_their_neighbour():
    figure = slice_figure(linear_volume(np.array([1.0, 0, 0]), oblique_affine()))
    figure.draw_without_rendering()
    axial, coronal, sagittal = (ax.get_position() for ax in figure.axes)
    assert coronal.y0 > axial.y1
    assert sagittal.x0 > coronal.x1
    assert coronal.y0 == pytest.approx(sagittal.y0, abs=0.02)
    assert coronal.x0 == pytest.approx(axial.x0, abs=0.02)


def test_a_margin_shows_the_surfaces_only_and_never_more_than_the_volume():
    volume = Volume(np.random.default_rng(0).random((40, 40, 40)), np.eye(4))
    ball = icosphere(3, 6.0, (20.0, 20.0, 5.0))
    axial, coronal, _ = slice_figure(volume, {"ball": ball}, margin_mm=4.0).axes
    np.testing.assert_allclose([*axial.get_xlim(), *axial.get_ylim()], [10, 30, 10, 30], atol=0.05)
    np.testing.assert_allclose(coronal.get_ylim(), [-0.5, 15], atol=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"planes": ("axial", "diagonal")}, "planes are"),
        ({"planes": ()}, "planes are"),
        ({"planes": ("axial", "axial")}, "each once"),
        ({"margin_mm": 3.0}, "a surface"),
        ({"margin_mm": -1.0, "meshes": {"ball": icosphere(1)}}, "margin_mm is -1.0"),
        ({"through_mm": (0, 0, 99)}, "point in the volume"),
        ({"through_mm": (0, 0)}, "point in the volume"),
    ],
)
def test_bad_places_are_refused(change, message):
    refuses(message, slice_figure, Volume(np.zeros((5, 5, 5)), np.eye(4)), **change)


def test_a_surface_beyond_the_volume_does_not_widen_the_picture():
    volume = Volume(np.random.default_rng(0).random((10, 10, 10)), np.eye(4))
    figure = slice_figure(volume, {"wide": icosphere(2, 40.0)}, through_mm=(5.0, 5.0, 5.0))
    assert figure.axes[0].get_xlim() == (-0.5, 9.5)
    plt.close(figure)


@pytest.mark.parametrize(("shift", "widths"), [(1.0, [2.8, 1.4]), (14.0, [1.2, 1.2])])
def test_lines_that_cannot_coincide_are_equally_thin(shift, widths):
    volume = linear_volume(np.array([1.0, 0, 0]), oblique_affine())
    places = {"one": CENTRE, "other": CENTRE + np.array([shift, 0, 0])}
    meshes = {name: icosphere(2, 10.0, tuple(place)) for name, place in places.items()}
    (ax,) = slice_figure(volume, meshes, planes=("axial",)).axes
    lines = [child for child in ax.get_children() if isinstance(child, LineCollection)]
    assert [float(line.get_linewidth()[0]) for line in lines] == widths
