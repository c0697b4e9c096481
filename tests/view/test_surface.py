"""Stills show what is there: silhouettes, sides, colours, scale."""

import hashlib
import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib import colormaps

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import ellipsoid, icosphere
from meshot.view.surface import AMBIENT, surface_figure, surface_image, view_from
from refusals import refuses

SIZE = (240, 180)
SIDES = ("left", "right", "anterior", "posterior", "superior", "inferior")


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def test_the_silhouette_of_a_sphere_is_a_disc_to_scale():
    image = surface_image(icosphere(4, 10.0), view_from("left"), size=SIZE, centre=np.zeros(3), half_height=15.0)
    assert image.shape == (180, 240, 4)
    opacity = image[..., 3] / 255
    assert opacity.sum() * (30 / 180) ** 2 == pytest.approx(np.pi * 100, rel=0.01)
    rows, columns = np.nonzero(opacity > 0.5)
    assert rows.mean() == pytest.approx(89.5, abs=0.2)
    assert columns.mean() == pytest.approx(119.5, abs=0.2)


def test_a_headlight_shades_by_the_cosine():
    image = surface_image(icosphere(5, 10.0), view_from("anterior"), size=SIZE, centre=np.zeros(3), half_height=15.0)
    row = image[90, :, 0].astype(float)
    middle, at_60_degrees = row[120], row[120 + round(10 * np.sin(np.pi / 3) / (30 / 180))]
    assert at_60_degrees / middle == pytest.approx(AMBIENT + 0.5 * (1 - AMBIENT), abs=0.04)


@pytest.mark.parametrize("side", SIDES)
def test_each_view_shows_its_own_side(side):
    """Values rise along the direction of sight: the middle of the picture is what faces the eye."""
    mesh = icosphere(4)
    view = view_from(side)
    image = surface_image(mesh, view, mesh.vertices @ torch.from_numpy(view.axes[2]), (-1, 1), "gray", SIZE)
    assert int(image[90, 120, 0]) > 245
    away = surface_image(mesh, view, -(mesh.vertices @ torch.from_numpy(view.axes[2])), (-1, 1), "gray", SIZE)
    assert int(away[90, 120, 0]) < 10


@pytest.mark.parametrize(
    ("name", "hemisphere", "letters"),
    [
        ("lateral", "left", ("A", "P", "I", "S")),
        ("medial", "left", ("P", "A", "I", "S")),
        ("lateral", "right", ("P", "A", "I", "S")),
        ("medial", "right", ("A", "P", "I", "S")),
        ("anterior", None, ("R", "L", "I", "S")),
        ("posterior", None, ("L", "R", "I", "S")),
        ("superior", None, ("L", "R", "P", "A")),
        ("inferior", None, ("R", "L", "P", "A")),
    ],
)
def test_the_letters_stand_where_a_knob_on_that_side_appears(name, hemisphere, letters):
    view = view_from(name, hemisphere)
    assert view.letters() == letters
    knobs = {"R": (1, 0, 0), "L": (-1, 0, 0), "A": (0, 1, 0), "P": (0, -1, 0), "S": (0, 0, 1), "I": (0, 0, -1)}
    image = surface_image(
        icosphere(2, 0.2, knobs[letters[0]]), view, None, size=SIZE, centre=np.zeros(3), half_height=1.5
    )
    rows, columns = np.nonzero(image[..., 3])
    assert columns.max() < SIZE[0] / 2
    assert abs(rows.mean() - 89.5) < 1
    image = surface_image(
        icosphere(2, 0.2, knobs[letters[3]]), view, None, size=SIZE, centre=np.zeros(3), half_height=1.5
    )
    assert np.nonzero(image[..., 3])[0].max() < SIZE[1] / 2


def test_the_upper_half_is_red_where_the_values_say_so():
    mesh = icosphere(5)
    values = np.where(mesh.vertices[:, 2] > 0, 1.0, 0.0)
    image = surface_image(mesh, view_from("left"), values, (0, 1), "coolwarm", SIZE).astype(int)
    red, blue = image[..., 0] > image[..., 2] + 40, image[..., 2] > image[..., 0] + 40
    seen = image[..., 3] > 250
    assert red[:88][seen[:88]].mean() > 0.98
    assert blue[92:][seen[92:]].mean() > 0.98


def test_values_beyond_the_limits_get_the_colour_of_the_end_and_missing_ones_none():
    mesh = icosphere(3)
    end = np.array(colormaps["viridis"](1.0)[:3]) * 255
    beyond = surface_image(mesh, view_from("left"), np.full(642, 7.0), (0, 1), size=SIZE)
    np.testing.assert_allclose(beyond[90, 120, :3], end, atol=3)
    missing = surface_image(mesh, view_from("left"), np.full(642, np.nan), (0, 1), size=SIZE)
    plain = surface_image(mesh, view_from("left"), None, size=SIZE)
    np.testing.assert_allclose(missing[90, 120], plain[90, 120], atol=2)


def test_two_runs_give_the_same_bytes():
    mesh = ellipsoid(4, (3.0, 2.0, 1.0))
    images = [surface_image(mesh, view_from("superior"), mesh.vertices[:, 0], (-3, 3), size=SIZE) for _ in range(2)]
    first, second = (hashlib.sha256(image.tobytes()).hexdigest() for image in images)
    assert first == second


def test_a_figure_has_a_row_for_each_mesh_one_scale_and_a_bar_with_its_unit():
    large, small = icosphere(3, 20.0), icosphere(3, 10.0)
    figure = surface_figure(
        {"before": large, "after": small},
        {"before": np.linspace(0, 5, 642), "after": np.linspace(0, 2, 642)},
        views=("lateral", "medial"),
        hemisphere="left",
        label="distance",
        limits=(0, 3),
        resolution=60,
    )
    panels = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in panels] == ["before, lateral", "before, medial", "after, lateral", "after, medial"]
    (bar,) = (ax for ax in figure.axes if not ax.images)
    assert bar.get_xlabel() == "distance (mm)"
    assert bar._colorbar.extend == "max"
    areas = [np.asarray(ax.images[0].get_array())[..., 3].sum() for ax in panels]
    assert areas[0] / areas[2] == pytest.approx(4, rel=0.03)
    assert any(text.get_text() == "10 mm" for ax in panels for text in ax.texts)


def test_surfaces_stand_abreast():
    meshes = {name: icosphere(2, 10.0) for name in "abc"}
    figure = surface_figure(meshes, views=("left",), abreast=2, resolution=60)
    assert [ax.get_title() for ax in figure.axes] == ["a", "b", "c", ""]
    assert [bool(ax.images) for ax in figure.axes] == [True, True, True, False]
    assert not figure.axes[3].axison
    figure.canvas.draw()
    places = [ax.get_position() for ax in figure.axes]
    assert places[0].y0 == pytest.approx(places[1].y0)
    assert places[0].x0 == pytest.approx(places[2].x0)
    assert places[0].y0 > places[2].y1
    assert places[0].x1 < places[1].x0
    figure = surface_figure(meshes, views=("left", "right"), abreast=2, resolution=60)
    assert [ax.get_title() for ax in figure.axes[:4]] == ["a, left", "a, right", "b, left", "b, right"]
    refuses("abreast", surface_figure, meshes, views=("left",), abreast=0)


@pytest.mark.parametrize(("radius", "length"), [(20.0, 10.0), (100.0, 50.0), (0.45, 0.2)])
def test_the_scale_bar_has_its_length(radius, length):
    figure = surface_figure(icosphere(2, radius), views=("left",), resolution=60)
    (ax,) = figure.axes
    (line,) = ax.lines
    assert np.ptp(line.get_xdata()) == pytest.approx(length)
    assert ax.texts[-1].get_text() == f"{length:g} mm"
    left, right = ax.get_xlim()
    seen = np.asarray(ax.images[0].get_array())[..., 3] > 127
    assert seen.any(axis=0).mean() * (right - left) == pytest.approx(2 * radius, rel=0.02)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"values": [1.0, 2.0]}, r"has shape \(2,\)"),
        ({"values": np.full(42, np.nan)}, "no finite entry"),
        ({"values": np.zeros(42), "limits": (1.0, 1.0)}, "increasing"),
        ({"values": np.zeros(42), "limits": (0.0, np.inf)}, "increasing"),
        ({"views": ("behind",)}, "view is 'behind'"),
        ({"views": ("lateral",)}, "say hemisphere"),
    ],
)
def test_bad_requests_are_refused(arguments, message):
    refuses(message, surface_figure, icosphere(1), **arguments)


@pytest.mark.parametrize(
    ("meshes", "values", "message"),
    [
        ({}, None, "meshes is empty"),
        ({"a": icosphere(0)}, {"b": np.zeros(12)}, "none of the meshes"),
        ({"a": icosphere(0)}, np.zeros(12), "a mapping by their names"),
    ],
)
def test_values_without_a_mesh_are_refused(meshes, values, message):
    refuses(message, surface_figure, meshes, values)


@pytest.mark.parametrize(("default", "drawn"), [(10.0, 12.0), (14.0, 14.0)])
def test_text_has_the_size_of_the_style_and_never_less_than_twelve_points(default, drawn):
    with plt.rc_context({"font.size": default}):
        figure = surface_figure({"a": icosphere(2, 10.0)}, views=("lateral",), hemisphere="left")
    (ax,) = figure.axes
    assert {text.get_fontsize() for text in (*ax.texts, ax.title)} == {drawn}


def test_one_value_everywhere_still_makes_a_picture():
    triangle = Mesh(torch.tensor([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]), torch.tensor([[0, 1, 2]]))
    figure = surface_figure(triangle, np.full(3, 2.0), views=("right",), resolution=50)
    assert figure.axes[-1].get_xlim() == (1.5, 2.5)


def test_the_first_picture_in_a_notebook_brings_no_warning():
    code = (
        "from ipykernel.zmqshell import ZMQInteractiveShell; ZMQInteractiveShell.instance(); "
        "from meshot.view.surface import surface_image; from meshot.view.surface import view_from; "
        "from meshot.mesh.shapes import icosphere; surface_image(icosphere(0), view_from('left'), size=(40, 30))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=True)
    assert done.stderr == ""
