"""Templates: they lie in the mean box of the training surfaces, and are closed spheres."""

import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.shapes import icosphere
from meshot.systems.learning import Template, TemplateSettings, mean_box, template_shape
from refusals import refuses


def test_the_mean_box_is_the_mean():
    boxes = mean_box([icosphere(2, 1.0), icosphere(2, 3.0, (2.0, 0.0, 0.0))])
    top = icosphere(2).vertices.amax(dim=0)
    torch.testing.assert_close(boxes[1].double(), 2 * top + torch.tensor([1.0, 0, 0]), atol=1e-6, rtol=0)


@pytest.mark.parametrize("shape", ["sphere", "fsaverage5"])
@pytest.mark.parametrize("splits", [0, 1])
def test_a_template_fills_its_box(shape, splits):
    box = torch.tensor([[-20.0, -5, 0], [-10, 5, 30]])
    mesh = Template("left", TemplateSettings(shape, 5, splits), box).mesh()
    assert len(mesh.vertices) == 10 * 4 ** (5 + splits) + 2
    assert topology(mesh) == SPHERE
    torch.testing.assert_close(torch.stack([mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)]), box)


def test_smoothing_smooths_and_sides_differ():
    rough, smooth = (template_shape("left", TemplateSettings(smoothing=n)) for n in (0, 20))
    assert smooth.vertices[:, 1].std() < rough.vertices[:, 1].std()
    assert (
        template_shape("right", TemplateSettings(smoothing=0)).vertices[:, 0].mean() > 0 > rough.vertices[:, 0].mean()
    )


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"shape": "cube"}, "shape is 'cube'; one of fsaverage5, sphere is needed"),
        ({"smoothing": -1}, "smoothing is -1; an integer in .0, 2000"),
        ({"splits": 4}, "splits is 4; an integer in .0, 3"),
        ({"surfaces": ["pial"]}, r"surfaces is \['pial'\]; \[white\] or \[white, pial\] is needed"),
        ({"surfaces": "white"}, r"surfaces is 'white'; \[white\] or \[white, pial\] is needed"),
    ],
)
def test_shapes_that_do_not_exist_are_refused(settings, words, unchecked):
    refuses(words, TemplateSettings, **settings)
