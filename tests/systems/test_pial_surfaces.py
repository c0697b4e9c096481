"""White and pial surfaces together: both template systems learn them, and weights are for the surfaces they say."""

import pytest
import torch

from meshot.mesh.editing import simplified
from meshot.metrics.distances import Surface, vertex_distances
from meshot.model.segmentation import segmentation_loss
from meshot.systems import ExampleSets, Part, Run, get_system, read_settings
from meshot.systems.corticalflow import FlowBlock, carried_through, train_block
from meshot.systems.learning import Template, TemplateSettings, mean_box, mean_distances, scaled_image
from meshot.systems.vox2cortex import N_STAGES, MeshNetwork, MeshWeights, template_name, true_fractions
from phantoms import phantom_subjects
from refusals import refuses

BOTH = {"shape": "sphere", "surfaces": ["white", "pial"]}
KEYS = (("left", "white"), ("left", "pial"), ("right", "white"), ("right", "pial"))
BOXES = {
    "left": torch.tensor([[-18.0, -8, -8], [-2, 8, 8]]), "right": torch.tensor([[2.0, -8, -8], [18, 8, 8]]),
    "left_pial": torch.tensor([[-19.0, -9, -9], [-1, 9, 9]]), "right_pial": torch.tensor([[1.0, -9, -9], [19, 9, 9]]),
}  # fmt: skip
NAMES = ["corticalflow", "deepcsr", "vox2cortex"]
#: The group of settings that names the surfaces of a system.
GROUP = {"corticalflow": "template", "deepcsr": "surface", "vox2cortex": "template"}
SHORT = {"corticalflow": ["training.n_epochs=3"], "vox2cortex": ["training.validate_every=3"], "deepcsr": []}


@pytest.fixture(scope="module")
def examples():
    torch.set_num_threads(1)
    return ExampleSets(phantom_subjects(4, (), pial=True), phantom_subjects(2, (), 50, pial=True))


@pytest.fixture
def network():
    """A network that moves vertices, since its last weights are not zero."""
    made = MeshNetwork(2, 2, 2, 4, 1, BOTH, BOXES)
    torch.manual_seed(0)
    for stage in made.stages:
        for layer in (stage.move.own, stage.move.others):
            torch.nn.init.normal_(layer.weight, std=0.01)
    return made


@pytest.mark.parametrize("name", NAMES)
def test_the_settings_say_which_surfaces_are_found(name):
    kind = get_system(name)
    white = tuple(key for key in KEYS if key[1] == "white")
    both = f"{GROUP[name]}.surfaces=[white, pial]"
    for config, changes, surfaces in (("tiny", [], white), ("small", [], white), ("small", [both], KEYS)):
        settings = read_settings(kind, config, changes)
        assert kind.surfaces_of(settings) == surfaces
        assert len(kind.parts_of(settings)) == (3 * len(surfaces) if name == "corticalflow" else 1)
    if name != "deepcsr":
        assert kind.surfaces_of(read_settings(kind, "paper")) == KEYS
    assert kind({}).surfaces == kind.surfaces_of(kind.complete({})) == white
    assert not hasattr(kind, "surfaces")
    assert kind({}).with_white_only().surfaces == white
    together = kind({})
    together.surfaces = KEYS
    refuses(f"{name} finds white and pial surfaces together, by one network", together.with_white_only)
    with pytest.raises(ValueError, match=r"surfaces is \['pial'\]; \[white\] or \[white, pial\] is needed"):
        read_settings(kind, "tiny", [f"{GROUP[name]}.surfaces=[pial]"])


def test_pial_templates_are_the_white_ones_in_their_own_boxes(examples):
    image = examples.validation[0].scan.image
    still = MeshNetwork(2, 2, 2, 4, 1, BOTH, BOXES)
    maps = still.unet(scaled_image(image))
    found = still.surfaces_after(maps, image, still.templates["right"].mesh(), "right")
    assert [list(each) for each in found] == [["white", "pial"]] * N_STAGES
    for kind, name in (("white", "right"), ("pial", "right_pial")):
        template = still.templates[name].mesh()
        torch.testing.assert_close(found[-1][kind].vertices, template.vertices)
        assert torch.equal(found[-1][kind].faces, template.faces)


def test_corresponding_vertices_of_both_surfaces_exchange_what_they_know(examples, network):
    image = examples.validation[0].scan.image
    mesh = network.templates["left"].mesh()
    with torch.no_grad():
        maps = network.unet(scaled_image(image))
        before = network.surfaces_after(maps, image, mesh, "left")
        order = torch.randperm(len(mesh.vertices), generator=torch.Generator().manual_seed(1))
        turned = type(mesh)(mesh.vertices[order], torch.argsort(order)[mesh.faces])
        after = network.surfaces_after(maps, image, turned, "left")
        for kind in ("white", "pial"):  # the order of the vertices does not matter, so that partners are partners
            torch.testing.assert_close(after[-1][kind].vertices, before[-1][kind].vertices[order], atol=1e-4, rtol=0)
        network.templates["left_pial"].box += 1.0
        moved = network.surfaces_after(maps, image, mesh, "left")
    assert not torch.allclose(moved[0]["white"].vertices, before[0]["white"].vertices, atol=1e-4)


def test_every_weight_has_a_gradient(examples, network):
    one = examples.training[0]
    maps = network.unet(scaled_image(one.scan.image))
    total = segmentation_loss(network.segmentation(maps), true_fractions(one))
    for side in ("left", "right"):
        for found in network.surfaces_after(maps, one.scan.image, network.templates[side].mesh(), side):
            total = total + sum(mesh.vertices.square().mean() for mesh in found.values())
    total.backward()
    assert [name for name, weight in network.named_parameters() if not float(weight.grad.abs().sum()) > 0] == []


def test_terms_of_pial_surfaces_weigh_as_in_the_authors_model():
    white = MeshWeights(edge=2.0, laplacian=0.2)
    pial = white.of("pial")
    assert white.of("white") == white
    assert (pial.laplacian, pial.normals, pial.consistency) == pytest.approx((0.5, 0.0125, 0.00225))
    assert (pial.chamfer, pial.edge, pial.extent) == (white.chamfer, white.edge, white.extent)


def test_a_pial_cascade_begins_at_the_white_surface_and_leaves_its_blocks_as_they_are(examples):
    settings = read_settings(get_system("corticalflow"), "tiny", ["training.side=left", "training.n_epochs=15"])
    box = mean_box([item.targets["left", "white"] for item in examples.training])
    white = [FlowBlock("left", k, **settings.network.as_dict(), template=BOTH, box=box, generator=k) for k in range(2)]
    with torch.no_grad():
        white[0].to_flow.bias.copy_(torch.tensor([0.3, 0.2, 0.1]))
    before = [{name: value.clone() for name, value in block.state_dict().items()} for block in white]
    network = FlowBlock("left", 0, **settings.network.as_dict(), template=BOTH)
    part = train_block(network, [], white, examples, settings, Run(), "left_pial_1")
    for block, state in zip(white, before, strict=True):
        assert all(torch.equal(value, state[name]) for name, value in block.state_dict().items())
    template, pairs = simplified(white[0].template.mesh(), 500), {"start": [], "end": []}
    for one in examples.validation:
        values, truth = scaled_image(one.scan.image), Surface(one.targets["left", "pial"])
        with torch.no_grad():
            start, _ = carried_through(white, template, one.scan.image, values, 3, "rk4")
            end, _ = part.network.carry(start, one.scan.image, values, None, 3, "rk4")
        pairs["start"].append((start, truth))
        pairs["end"].append((end, truth))
    first, last = (mean_distances(each, 2000)["validation_loss"] for each in pairs.values())
    assert last < 0.8 * first
    assert min(x["validation_loss"] for x in part.log if "validation_loss" in x) == pytest.approx(last, rel=1e-3)


@pytest.fixture(scope="module", params=NAMES)
def trained(request, examples):
    """A system that was trained for all four surfaces, briefly."""
    kind = get_system(request.param)
    changes = [*SHORT[kind.name], f"{GROUP[kind.name]}.surfaces=[white, pial]"]
    return kind.train(examples, read_settings(kind, "tiny", changes), device=torch.device("cpu"))


def test_both_kinds_come_nearer_to_the_truth(trained, examples):
    found = [trained.reconstruct(item.scan) for item in examples.validation]
    for kind in ("white", "pial"):
        keys = [key for key in KEYS if key[1] == kind]
        truths = [(i, key, Surface(item.targets[key])) for i, item in enumerate(examples.validation) for key in keys]
        start = mean_distances([(template_of(trained, key), truth) for _, key, truth in truths], 2000)
        end = mean_distances([(found[i][key], truth) for i, key, truth in truths], 2000)
        assert end["validation_loss"] < 0.9 * start["validation_loss"]


def template_of(system, key):
    """Where a surface begins. DeepCSR has no template: an ellipsoid in the box of the surface instead."""
    if system.name == "deepcsr":
        return Template(key[0], TemplateSettings("sphere"), BOXES["_".join(key).removesuffix("_white")]).mesh()
    if system.name == "vox2cortex":
        return system.parts["meshes"].network.templates[template_name(key)].mesh()
    return system.parts[f"{key[0]}_white_1"].network.template.mesh()


def test_white_and_pial_surfaces_are_learned_saved_and_found(trained, examples, tmp_path):
    kind, one = type(trained), examples.validation[0]
    trained.save(tmp_path)
    loaded = kind.load(tmp_path)
    assert trained.surfaces == loaded.surfaces == KEYS
    found, again = trained.reconstruct(one.scan), loaded.reconstruct(one.scan)
    assert tuple(found) == KEYS
    assert all(torch.equal(mesh.vertices, again[key].vertices) for key, mesh in found.items())
    if kind.name == "corticalflow":  # the pial cascade goes on from the white surface
        blocks = [trained.parts[f"right_pial_{k}"].network for k in (1, 2, 3)]
        start, values = found["right", "white"].to(torch.float32), scaled_image(one.scan.image)
        with torch.no_grad():
            by_hand, _ = carried_through(blocks, start, one.scan.image, values, 3, "rk4")
        torch.testing.assert_close(found["right", "pial"].vertices, by_hand.vertices.double())
    for side in ("left", "right"):
        assert kind.name == "deepcsr" or torch.equal(found[side, "white"].faces, found[side, "pial"].faces)
        away = vertex_distances(found[side, "pial"], found[side, "white"]).mean()
        assert 0.3 < away < 2.0  # 1 mm in truth
    assert all(part.record[GROUP[kind.name]]["surfaces"] == ["white", "pial"] for part in loaded.parts.values())


def test_an_example_without_a_pial_surface_is_refused(examples, trained):
    poor = phantom_subjects(1, ())
    with pytest.raises(ValueError, match=r"phantom-0 has no true surface left pial, right pial; .* learns from it"):
        type(trained).train(ExampleSets(poor, poor), {GROUP[trained.name]: {"surfaces": BOTH["surfaces"]}})


def test_weights_of_other_surfaces_are_refused(trained, tmp_path):
    kind, parts = type(trained), trained.parts
    if kind.name == "vox2cortex":
        words = r"weights of vox2cortex are for left white, left pial, .* name left white, right white: take weights"
        refuses(words, kind, {"meshes": Part(parts["meshes"].network, {})})
        return
    if kind.name == "deepcsr":
        words = (
            r"weights of deepcsr are for 4 surfaces, .*surface\.surfaces\) name left white, right white: take weights"
        )
        refuses(words, kind, {"distances": Part(parts["distances"].network, {})})
        return
    white_only = parts["right_white_1"].record | {"template": {"shape": "sphere"}}
    mixed = parts | {"right_white_1": Part(parts["right_white_1"].network, white_only)}
    words = (
        r"left_white_1 of corticalflow was trained for left white, left pial, .* right_white_1 for left white, right"
    )
    refuses(words, kind, mixed)
    with pytest.raises(
        ValueError, match=r"corticalflow has no part left_pial_1, left_pial_2, .*; its parts are left_w"
    ):
        kind({name: Part(part.network, white_only) for name, part in parts.items()})
    trained.save(tmp_path)
    (tmp_path / "left_pial_2.safetensors").unlink()
    refuses(r"left_pial_2\.safetensors is missing; corticalflow needs .*, right_pial_3: na", kind.load, tmp_path)
    half = kind({name: part for name, part in parts.items() if "pial" not in name})
    with pytest.raises(ValueError, match="corticalflow has no trained left_pial_1, left_pial_2, left_pial_3, right_pi"):
        half.reconstruct(phantom_subjects(1, ())[0].scan)
