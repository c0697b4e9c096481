"""The systems that start from whole scans: trained, saved, loaded, and what they refuse."""

import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.systems import Example, ExampleSets, Scan, get_system, read_settings
from phantoms import phantom_subjects
from refusals import refuses

NAMES = ["corticalflow", "deepcsr", "vox2cortex", "classical"]
#: The largest mean distance (mm) of the vertices that is accepted of a tiny training.
FARTHEST = {"corticalflow": 1.0, "deepcsr": 0.6, "vox2cortex": 1.2, "classical": 0.3}

#: The largest validation loss that is accepted: the mean distance in mm of the surfaces, or of deepcsr's distances.
BOUND = {"corticalflow": 1.0, "deepcsr": 0.6, "vox2cortex": 1.0, "classical": 0.01}


@pytest.fixture(scope="module", params=NAMES)
def kind(request):
    torch.set_num_threads(1)
    return get_system(request.param)


@pytest.fixture(scope="module")
def examples():
    return ExampleSets(phantom_subjects(2, ()), phantom_subjects(1, (), 50))


@pytest.fixture(scope="module")
def whole(kind, examples):
    return kind.train(examples, read_settings(kind, "tiny"))


def test_training_lowers_what_is_validated(kind, whole):
    for name, part in whole.parts.items():
        found = [line["validation_loss"] for line in part.log if "validation_loss" in line]
        assert len(found) > 1
        assert min(found) < BOUND[kind.name], name
        assert part.record["results"]["n_weights"] > 0


def test_it_saves_loads_and_reconstructs(kind, examples, whole, tmp_path):
    whole.save(tmp_path)
    loaded = kind.load(tmp_path)
    scan = examples.validation[0].scan
    found, wanted = loaded.reconstruct(scan), whole.reconstruct(scan)
    assert tuple(found) == loaded.surfaces
    for key, mesh in found.items():
        torch.testing.assert_close(mesh.vertices, wanted[key].vertices, atol=1e-4, rtol=0)
        assert topology(mesh) == SPHERE
        assert vertex_distances(mesh, examples.validation[0].targets[key]).mean() < FARTHEST[kind.name]


def test_what_does_not_fit_is_refused(kind, examples, whole, tmp_path):
    scan = examples.validation[0].scan
    with pytest.raises(ValueError, match=f"has an initial surface left white; {kind.name} takes none: leave it out"):
        whole.reconstruct(Scan(scan.image, {("left", "white"): icosphere(1)}))
    one = examples.training[0]
    poor = Example("poor", one.scan, {("left", "white"): one.targets["left", "white"]})
    with pytest.raises(ValueError, match=f"poor has no true surface right white; {kind.name} learns from it"):
        kind.train(ExampleSets([one], [poor]), {})
    name = next(iter(whole.parts))
    some = kind({})
    refuses(f"{kind.name} has no trained {name}", some.reconstruct, scan)
    whole.save(tmp_path)
    (tmp_path / f"{name}.safetensors").write_bytes(b"")
    refuses("does not hold the weights of a", kind.load, tmp_path)
    twin = type("Twin", (kind,), {"name": "twin"})
    whole.save(tmp_path)
    refuses(f"holds weights of the system {kind.name}; twin was asked for", twin.load, tmp_path)
