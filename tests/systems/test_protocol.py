"""A template, a chain of flows and an implicit surface fit the protocol: trained, killed, resumed, saved, loaded."""

import pytest
import torch

from killing import same, without_seconds
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.systems import Example, ExampleSets, Part, Scan, get_system
from phantoms import phantom_subjects
from refusals import refuses

SETTINGS = {"training": {"n_steps": 40}}


class Kill(Exception):
    """A process that ends in the middle."""


@pytest.fixture(params=["template", "chain", "implicit"])
def kind(request, toys):
    torch.set_num_threads(1)
    return get_system(request.param)


@pytest.fixture
def examples(kind):
    return ExampleSets(phantom_subjects(2, kind.needs), phantom_subjects(1, kind.needs, 50))


def test_a_toy_goes_all_the_way(kind, examples, tmp_path):
    whole = kind.train(examples, SETTINGS)
    told = []

    def die(step: int, n_steps: int, line: dict) -> None:
        told.append(step)
        if len(told) == 27 + 44 * (len(kind.networks) - 1):  # in the last of its parts
            raise Kill

    with pytest.raises(Kill):
        kind.train(examples, SETTINGS, tmp_path / "state", die)
    resumed = kind.train(examples, SETTINGS, tmp_path / "state")
    for name, part in whole.parts.items():
        assert same(resumed.parts[name].network, part.network)
        assert without_seconds(resumed.parts[name].log) == without_seconds(part.log)
        assert part.log[-1]["validation_loss"] < 0.8 * part.log[0]["loss"]
    resumed.save(tmp_path / "weights")
    loaded = kind.load(tmp_path / "weights")
    scan = examples.validation[0].scan
    found, wanted = loaded.reconstruct(scan), whole.reconstruct(scan)
    assert tuple(found) == kind.surfaces
    for key, mesh in found.items():
        assert torch.equal(mesh.vertices, wanted[key].vertices)
        truth = examples.validation[0].targets[key]
        assert vertex_distances(mesh, truth).mean() < 1.0
    assert loaded.parts[name].record["training"] == {"n_steps": 40, "learning_rate": 0.1}
    assert loaded.parts[name].record["results"]["n_steps"] == 40


def test_weights_of_another_system_and_missing_ones_are_refused(toys, tmp_path):
    chain, template = get_system("chain"), get_system("template")
    affine = chain.networks["first"]()
    refuses(r"chain has no part placement; its parts are first, second", chain, {"placement": Part(affine)})
    half = chain({"first": Part(affine)})
    half.save(tmp_path)
    refuses(r"second\.safetensors is missing; chain needs first, second: .*train chain", chain.load, tmp_path)
    start = Scan(phantom_subjects(1, ())[0].scan.image, {("left", "white"): icosphere(1)})
    refuses("chain has no trained second, only first: train what is missing", half.reconstruct, start)
    template({"placement": Part(template.networks["placement"]())}).save(tmp_path)
    (tmp_path / "placement.safetensors").rename(tmp_path / "threshold.safetensors")
    refuses("does not hold the weights of a Threshold", get_system("implicit").load, tmp_path)
    renamed = type("Twin", (template,), {"name": "twin"})
    (tmp_path / "threshold.safetensors").rename(tmp_path / "placement.safetensors")
    refuses(r"holds weights of the system template; twin was asked for: take --system t", renamed.load, tmp_path)


def test_initial_surfaces_come_to_those_that_need_them_and_to_no_others(toys):
    with_initial, without = (phantom_subjects(1, needs)[0].scan for needs in ([("left", "white")], []))
    template, chain = get_system("template"), get_system("chain")
    trained = template({"placement": Part(template.networks["placement"]())})
    refuses("has an initial surface left white; template takes none: leave it out", trained.reconstruct, with_initial)
    with pytest.raises(ValueError, match="the scan has no initial surface left white; chain starts from it: make one"):
        chain({name: Part(made()) for name, made in chain.networks.items()}).reconstruct(without)


def test_examples_that_will_not_do_are_refused(toys):
    template, (one,) = get_system("template"), phantom_subjects(1, ())
    refuses("1 examples for training and 0 for validation", template.train, ExampleSets([one], []), SETTINGS)
    poor = Example("poor", one.scan, {("left", "white"): one.targets["left", "white"]})
    with pytest.raises(ValueError, match="poor has no true surface right white; template learns from it"):
        template.train(ExampleSets([one], [poor]), SETTINGS)
    with pytest.raises(ValueError, match=r"training\.speed, which nothing reads"):
        template.train(ExampleSets([one], [one]), {"training": {"speed": 1}})
