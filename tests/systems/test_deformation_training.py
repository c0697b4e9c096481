"""Algorithm 1: it brings surfaces nearer, goes on after a kill as if nothing had been, and refuses what breaks."""

import dataclasses
import json

import numpy as np
import pytest
import torch

from killing import killed_after_its_first_state, same
from meshot import provenance as results
from meshot.flow.integration import integrate
from meshot.loss.directions import random_directions
from meshot.loss.sliced import sliced_wasserstein
from meshot.measure.discrete import varifold
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights, write_weights
from meshot.pipeline.training import InitialSurfaces, run_system_training
from meshot.provenance import read_results
from meshot.synth.cohorts import scans
from meshot.systems import get_system
from meshot.systems.flows import (
    DeformationConfig,
    carried,
    deformed,
    hemisphere_example,
    scaled_between_tissues,
    standardised,
    train_deformation,
    velocity_field,
)
from meshot.volume.surfaces import enclosed_fractions
from meshot.volume.volume import Volume, sample_volume
from phantoms import phantom_deformations, write_phantom_cohort
from refusals import refuses

TINY = DeformationConfig.read(
    {
        "network": {"width": 6, "hidden": [8], "n_scales": 2, "size": 3, "extent": 10.0},
        "loss": {"n_directions": 20, "normal_scale": 1.0},
        "training": {
            "n_epochs": 3, "learning_rate": 0.01, "n_flow_steps": 2, "save_every": 2, "n_points": 500,
            "schedule": "cosine",
        },
    }
)  # fmt: skip
RIGHT = [("right", "white")]


class Kill(Exception):
    """A process that ends in the middle."""


def changed(**settings: object) -> DeformationConfig:
    return dataclasses.replace(TINY, training=dataclasses.replace(TINY.training, **settings))


@pytest.fixture(scope="module")
def examples():
    torch.set_num_threads(1)
    return phantom_deformations(3), phantom_deformations(1, seed=50)


@pytest.fixture(scope="module")
def whole(examples):
    return train_deformation(TINY, *examples)


def test_one_step_is_algorithm_1_by_hand(examples):
    config = changed(n_epochs=1, schedule="constant")
    one = examples[0][:1]
    found = train_deformation(config, one, examples[1])
    network = config.new_network()
    optimiser = torch.optim.Adam(network.parameters(), lr=0.01)
    # the ODE, from the initial surface
    moved = integrate(
        network.velocity_in(standardised(one[0].scan, one[0].initial)), one[0].coarse.vertices, 2, "euler"
    )
    # both meshes to measures, and the loss between them
    predicted, target = (
        varifold(one[0].coarse.with_vertices(moved), normal_scale=1.0),
        varifold(one[0].target, normal_scale=1.0),
    )
    directions = random_directions(20, 6, np.random.default_rng([0, 1, 0]), torch.float32)
    loss = sliced_wasserstein(predicted, target, directions)
    loss.backward()
    optimiser.step()
    assert found.log[0]["loss"] == pytest.approx(float(loss.detach()), rel=1e-5)
    for name, value in network.state_dict().items():
        torch.testing.assert_close(found.network.state_dict()[name], value, rtol=1e-4, atol=1e-5)


def test_a_field_that_is_kept_follows_the_network(examples):
    network, item = TINY.new_network(), examples[0][0]
    kept = velocity_field(network, item.scan, item.initial)
    before = carried(item.coarse, kept, TINY.training).vertices
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1)
    after = carried(item.coarse, kept, TINY.training).vertices
    fresh = carried(item.coarse, velocity_field(network, item.scan, item.initial), TINY.training).vertices
    assert torch.equal(after, fresh)
    assert not torch.equal(after, before)


def test_the_radius_of_windows_falls_with_the_steps(examples):
    def losses(window, last):
        loss = {"loss": "windowed", "n_windows": 4, "n_directions": 8, "normal_scale": 1.0, "window": window}
        loss |= {"last_window": last} if last else {}
        config = DeformationConfig.read(TINY.as_dict() | {"loss": loss})
        # So small a rate that the network stays as it is: only the radius can change a loss.
        config = dataclasses.replace(config, training=dataclasses.replace(config.training, learning_rate=1e-30))
        return [line["loss"] for line in train_deformation(config, *examples).log if "loss" in line]

    fixed, falling, fourth = map(losses, (6.0, 6.0, 6.0 * 0.5 ** (4 / 9)), (None, 3.0, None))
    assert len(fixed) == 9
    assert falling[0] == fixed[0]
    # The same network and draws. The two radii differ by a rounding, a loss in float32 by 6e-8 of its size.
    assert falling[4] == pytest.approx(fourth[4], rel=1e-5)
    assert falling[4] != pytest.approx(fixed[4], rel=1e-3)


@pytest.mark.parametrize("loss", [{}, {"loss": "chamfer", "encoding": "samples", "factor": 1000.0}])
def test_surfaces_come_nearer_even_those_never_seen(examples, loss):
    content = TINY.as_dict()
    content["loss"] = loss or content["loss"]
    content["training"] |= {"n_epochs": 40, "validate_every": 20}
    found = train_deformation(DeformationConfig.read(content), *examples)
    item = examples[1][0]
    before = float(vertex_distances(item.initial, item.target).mean())
    after = float(vertex_distances(deformed(item.initial, item.scan, found.network, 2), item.target).mean())
    assert after < 0.6 * before
    assert min(line["validation_loss"] for line in found.log if "validation_loss" in line) < 0.6 * before


VICTIM = """
from systems.test_deformation_training import TINY
from phantoms import phantom_deformations
from meshot.systems import train_deformation
train_deformation(TINY, phantom_deformations(3), phantom_deformations(1, seed=50), folder={folder!r})
"""


def test_a_process_killed_by_the_system_goes_on(tmp_path, whole, examples, root):
    killed_after_its_first_state(VICTIM.format(folder=str(tmp_path)), root / "tests", tmp_path)
    assert same(train_deformation(TINY, *examples, folder=tmp_path).network, whole.network)


def test_the_seed_decides(examples, whole):
    assert not same(train_deformation(changed(seed=1), *examples).network, whole.network)


def test_a_validation_that_fails_names_its_step(examples):
    with pytest.raises(FloatingPointError, match=r"the validation after step 1 failed: .*lower the learning rate"):
        train_deformation(changed(learning_rate=1e30, schedule="constant"), examples[0][:1], examples[1])


def test_validation_subjects_of_one_name_keep_their_own_truth(examples):
    first, second = phantom_deformations(2, seed=50)
    config = changed(n_epochs=1, learning_rate=1e-12)
    apart = train_deformation(config, examples[0][:1], [first, second])
    alike = train_deformation(config, examples[0][:1], [first, dataclasses.replace(second, name=first.name)])
    assert alike.log[-1]["validation_loss"] == apart.log[-1]["validation_loss"]


def test_no_examples_and_another_training_are_refused(tmp_path, examples):
    refuses("0 examples for training and 1 for validation", train_deformation, TINY, [], examples[1])
    train_deformation(changed(n_epochs=1), *examples, folder=tmp_path)
    refuses("made with another training", train_deformation, changed(n_epochs=1, seed=9), *examples, folder=tmp_path)


def test_a_constant_scan_is_refused_before_the_first_step(examples):
    item = examples[0][0]
    flat = dataclasses.replace(item, scan=item.scan.with_data(0 * item.scan.data))
    with pytest.raises(ValueError, match="the image is 0 at every vertex of the surface"):
        train_deformation(TINY, [item, flat], examples[1], progress=lambda *_: pytest.fail("a step was made"))


def test_a_flow_that_leaves_finite_numbers_is_refused(examples):
    network = DeformationNetwork(4, (4,), 1, 3)
    torch.nn.init.constant_(network.to_velocity.bias, float("nan"))
    refuses("not finite", deformed, examples[0][0].initial, examples[0][0].scan, network)


def test_gain_and_offset_of_the_scanner_do_not_matter(whole, examples):
    item = examples[1][0]
    here = deformed(item.initial, item.scan, whole.network, 2).vertices
    louder = deformed(item.initial, item.scan.with_data(300 * item.scan.data + 17), whole.network, 2).vertices
    torch.testing.assert_close(here, louder, rtol=0, atol=1e-4)
    assert float((here - item.initial.vertices).norm(dim=1).mean()) > 0.01
    values = sample_volume(standardised(item.scan, item.initial), item.initial.vertices.double())
    assert float(values.mean().abs()) < 1e-5
    assert float(values.std()) == pytest.approx(1, rel=1e-5)
    refuses("at every vertex of the surface", standardised, item.scan.with_data(0 * item.scan.data), item.initial)


@pytest.fixture(scope="module")
def biased_ball():
    """White matter of 0.8 in a ball of 25 mm, 4 mm of grey matter of 0.5 around it, fluid; a bias of a factor of 2."""
    affine = np.eye(4)
    affine[:3, 3] = -40
    grid = Volume(np.zeros((81, 81, 81)), affine)
    white, brain = (enclosed_fractions(icosphere(5, radius), grid) for radius in (25.0, 29.0))
    bias = 2 ** (np.arange(81)[:, None, None] / 80 - 0.5)
    return grid.with_data((0.8 * white + 0.5 * (brain - white) + 0.1 * (1 - brain)) * bias)


@pytest.mark.parametrize("radius", [24.5, 25.0, 26.0])
def test_the_border_of_tissues_is_near_zero_if_the_surface_is_near(biased_ball, radius):
    scaled = scaled_between_tissues(biased_ball, icosphere(5, radius))

    def values(at):
        return sample_volume(scaled, icosphere(4, at).vertices.double())

    means = [float(values(at).mean()) for at in (22.0, 25.0, 27.0)]
    assert means == pytest.approx([1, 0, -1], abs=0.15)
    # The bias is a third of the contrast on both sides. It is gone but for what a Gaussian of 15 mm leaves.
    plain = sample_volume(standardised(biased_ball, icosphere(5, radius)), icosphere(4, 22.0).vertices.double())
    assert float(values(22.0).std()) < 0.25 * float(plain.std()) * abs(means[0] - means[2])


def test_gain_and_offset_do_not_matter_between_tissues(biased_ball):
    sphere = icosphere(4, 25.0)
    one, other = (scaled_between_tissues(biased_ball.with_data(f(biased_ball.data)), sphere).data
                  for f in (lambda x: x, lambda x: 300 * x + 17))  # fmt: skip
    np.testing.assert_allclose(one, other, atol=1e-3)


def test_dark_white_matter_is_refused(biased_ball):
    with pytest.raises(ValueError, match=r"white matter beside the surface has the value -0\.\d+ and grey matter"):
        scaled_between_tissues(biased_ball.with_data(-biased_ball.data), icosphere(4, 25.0))


def test_a_network_sees_the_image_that_it_learned_from(examples, tmp_path, unchecked):
    item = examples[1][0]
    networks = [DeformationNetwork(8, (16,), 2, 3, intensities=name).float() for name in ("surface", "tissues")]
    for network in networks:
        network.load_state_dict(networks[0].state_dict())
        torch.nn.init.ones_(network.to_velocity.weight)
    moved = [deformed(item.initial, item.scan, network, 2).vertices for network in networks]
    assert not torch.allclose(*moved, atol=1e-3)
    write_weights(tmp_path / "a.safetensors", networks[1], {})
    again = read_weights(tmp_path / "a.safetensors", DeformationNetwork)[0]
    assert torch.equal(deformed(item.initial, item.scan, again, 2).vertices, moved[1])
    refuses("intensities is 'air'", DeformationNetwork, intensities="air")


def test_the_coarse_surface_moves_as_in_the_training(whole, examples):
    item, settings = examples[1][0], TINY.training
    field = velocity_field(whole.network, item.scan, item.initial)
    expected = carried(item.coarse, field, settings).vertices.detach()
    flow = settings.n_flow_steps, settings.method
    as_trained = deformed(item.coarse, item.scan, whole.network, *flow, standard=item.initial)
    # In float32, positions of up to 128 mm are rounded to 8e-6 mm.
    torch.testing.assert_close(as_trained.vertices, expected, rtol=0, atol=1e-4)
    alone = deformed(item.coarse, item.scan, whole.network, *flow)
    assert float((alone.vertices - expected).abs().max()) > 1e-3


@pytest.fixture
def cohort(tmp_path, monkeypatch):
    """Phantoms on disk, and a segmentation that finds what is bright on either side, without being trained."""
    import meshot.pipeline.segmentation as segmenting

    def bright(scan, network):
        left = np.arange(scan.data.shape[0])[:, None, None] < scan.data.shape[0] // 2
        high = np.clip((scan.data - 0.45) / 0.3, 0, 1)
        return {"left": scan.with_data(high * left), "right": scan.with_data(high * ~left)}

    monkeypatch.setattr(segmenting, "segment", bright)
    write_weights(tmp_path / "segmentation.safetensors", SegmentationNetwork(2, 1), {})
    return write_phantom_cohort(tmp_path / "phantoms", ["train", "train", "validation"])


def test_initial_surfaces_are_made_once_for_each_network(tmp_path, cohort, monkeypatch):
    network = SegmentationNetwork(2, 1)
    surfaces = InitialSurfaces(tmp_path / "initial", network)
    found = surfaces.examples([cohort], "train", RIGHT, RIGHT)
    first = [hemisphere_example(item, "right", 500) for item in found]
    assert [item.name for item in first] == ["phantoms/sub-001", "phantoms/sub-002"]
    assert len(first[0].coarse.faces) == 500 < len(first[0].initial.faces)
    assert float(vertex_distances(first[0].initial, first[0].target).mean()) < 1.5
    monkeypatch.setattr("meshot.pipeline.training.initial_surfaces", None)
    again = InitialSurfaces(tmp_path / "initial", network).examples([cohort], "train", RIGHT, RIGHT)
    assert torch.equal(again[1].scan.initial["right", "white"].vertices.float(), first[1].initial.vertices)
    with pytest.raises(TypeError):  # another network has surfaces of its own
        InitialSurfaces(tmp_path / "initial", SegmentationNetwork(2, 1, generator=1)).examples(
            [cohort], "train", RIGHT, RIGHT
        )
    refuses("no scan of the split 'test'", surfaces.examples, [cohort], "test", RIGHT, RIGHT)
    (bare, _) = surfaces.examples([cohort], "train", RIGHT, ())  # for a system that needs none
    assert (bare.scan.initial, set(bare.targets)) == ({}, set(RIGHT))
    refuses("none is made of right pial", surfaces.examples, [cohort], "train", RIGHT, [("right", "pial")])


def test_initial_surfaces_are_found_by_their_scan(tmp_path, cohort, monkeypatch):
    surfaces = InitialSurfaces(tmp_path / "initial", SegmentationNetwork(2, 1))
    subject = scans(cohort)[0]
    kept = surfaces.path(subject, "left", subject.standard())
    surfaces.of(subject, "left")
    # Under another name of the same folder, too.
    monkeypatch.chdir(cohort)
    (here,) = [found for found in scans(".") if found.name == subject.name]
    assert surfaces.path(here, "left", here.standard()) == kept
    assert surfaces.example(here, RIGHT, ()).name == "phantoms/sub-001"
    # What another training may have read stays as it is.
    surfaces.path(subject, "right", subject.standard()).unlink()
    before = kept.stat().st_mtime_ns
    surfaces.of(subject, "right")
    assert kept.stat().st_mtime_ns == before
    # Another scan has another surface.
    louder = subject.standard()
    louder.volume.data[3, 3, 3] += 0.1
    monkeypatch.setattr(type(subject), "standard", lambda _: louder)
    assert surfaces.path(subject, "left", louder) != kept
    surfaces.of(subject, "left")
    assert surfaces.path(subject, "left", louder).is_file()


def test_everything_is_written_with_its_provenance(tmp_path, cohort):
    config = tmp_path / "c.yaml"
    config.write_text(json.dumps(TINY.as_dict()))
    out = tmp_path / "out"
    changes = ["training.n_faces=400"]
    found = run_system_training(
        "ddot", config, [cohort], out, tmp_path / "segmentation.safetensors", tmp_path / "initial", changes,
        torch.device("cpu"),
    )  # fmt: skip
    again = get_system("ddot").load(out)
    assert set(again.parts) == {"left_white", "right_white"}
    for name, part in again.parts.items():
        assert same(part.network, found.parts[name].network)
        assert part.record["training"] == TINY.as_dict()["training"] | {"n_faces": 400, "side": name.split("_")[0]}
        assert (part.record["system"], part.record["part"]) == ("ddot", name)
        assert part.record["command"] == (
            "meshot train ddot c.yaml --data phantoms -o out --segmentation segmentation.safetensors "
            f"--threads {torch.get_num_threads()} --device cpu --set training.n_faces=400"
        )
        assert part.record["results"]["segmentation_sha256"]
        assert read_results(out / f"{name}.json")["config"]["training"] == part.record["training"]
        assert (out / f"{name}.png").stat().st_size > 5000
        assert len((out / f"{name}.log.jsonl").read_text(encoding="utf-8").splitlines()) == len(found.parts[name].log)
    assert not same(*(part.network for part in again.parts.values()))


def test_a_training_is_of_the_code_that_it_began_with(tmp_path, cohort, monkeypatch):
    config, out = tmp_path / "c.yaml", tmp_path / "out"
    config.write_text(json.dumps(TINY.as_dict()))
    words = "ddot", config, [cohort], out, tmp_path / "segmentation.safetensors", tmp_path / "initial"

    read = InitialSurfaces.examples

    def examples(*words: object) -> list:
        monkeypatch.setattr(results, "commit_of", lambda _: "committed meanwhile")
        return read(*words)

    def record(now: str) -> dict:
        monkeypatch.setattr(results, "commit_of", lambda _: now)
        run_system_training(*words)
        return json.loads((out / "left_white.json").read_text(encoding="utf-8"))

    def stop(*_: object) -> None:
        raise Kill

    monkeypatch.setattr(InitialSurfaces, "examples", examples)
    with monkeypatch.context() as patch:
        patch.setattr("meshot.systems.flows.mean_distances", stop)
        monkeypatch.setattr(results, "commit_of", lambda _: "first")
        with pytest.raises(Kill):
            run_system_training(*words)
    found = record("second")
    assert found["commit"] == "second"
    assert found["results"]["commits"] == ["first", "second"]
    # Written again when all was done, it is still of the code that took the steps.
    assert record("third")["commit"] == "second"
    assert record("third")["results"]["commits"] == ["first", "second"]


def test_a_network_too_large_to_be_kept_is_refused_at_once(tmp_path, cohort):
    config = tmp_path / "c.yaml"
    config.write_text(json.dumps(TINY.as_dict()))
    with pytest.raises(ValueError, match="MB; at most 10 MB are kept"):
        run_system_training(
            "ddot", config, [cohort], tmp_path / "out", tmp_path / "segmentation.safetensors", tmp_path / "initial",
            ["network.width=128", "network.hidden=[2000, 2000]"],
        )  # fmt: skip
    assert not (tmp_path / "initial").exists()
