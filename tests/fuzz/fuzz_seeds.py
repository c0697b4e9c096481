"""Whole files of every kind that the package reads, written by itself or by the libraries, and what reads them."""

import functools
import gzip
import io
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import nibabel
import numpy as np
import torch

from meshot.flow import GridVelocity, read_velocity, write_velocity
from meshot.flow.fitting import FitState
from meshot.mesh import icosphere, read_mesh, write_mesh
from meshot.model import SegmentationNetwork, read_weights, write_weights
from meshot.pipeline.segmentation import read_segmentation_config
from meshot.provenance import FIELDS, read_results
from meshot.settings import read_groups
from meshot.synth import read_recipe
from meshot.systems.flows import DeformationConfig
from meshot.train import TrainingState, read_log
from meshot.train.state import read_training, write_training
from meshot.volume import read_volume

PACKAGE = Path(__file__).parents[2] / "src" / "meshot"
OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
)


def fit_state() -> FitState:
    """A small field before its fit."""
    field = GridVelocity(torch.zeros(3), torch.ones(3), (0.5,), 1)
    return FitState(field, 0.001, 4)


def training_state() -> TrainingState:
    """A small network after one step."""
    network = SegmentationNetwork(2, 2)
    state = TrainingState(network, 0.001)
    sum(parameter.sum() for parameter in network.parameters()).backward()
    state.optimiser.step()
    return state


def _written(name: str, write: Callable[[Path], object]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _mesh(name: str) -> bytes:
    return _written(name, lambda path: write_mesh(path, icosphere(1)))


def _ascii_gifti() -> bytes:
    mesh = icosphere(0)
    arrays = [
        nibabel.gifti.GiftiDataArray(array, intent=intent, encoding="ASCII", datatype=kind)
        for array, intent, kind in (
            (mesh.vertices.float().numpy(), "NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32"),
            (mesh.faces.int().numpy(), "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32"),
        )
    ]
    return nibabel.GiftiImage(darrays=arrays).to_bytes()


def _image(kind: type, packed: bool) -> bytes:
    image = kind(np.random.default_rng(0).normal(size=(5, 6, 7)).astype(np.float32), np.eye(4))
    stream = io.BytesIO()
    image.to_stream(stream)
    return gzip.compress(stream.getvalue(), mtime=0) if packed else stream.getvalue()


#: By the name of the file: what makes a whole one, and what reads it.
KINDS: dict[str, tuple[Callable[[], bytes], Callable[[Path], object]]] = {
    "text.ply": (lambda: PLY.encode(), read_mesh),
    "text.off": (lambda: OFF.encode(), read_mesh),
    "text.stl": (lambda: STL.encode(), read_mesh),
    "text.gii": (_ascii_gifti, read_mesh),
    "unnamed": (lambda: _mesh("lh.white"), read_mesh),
    **{
        name: (functools.partial(_mesh, name), read_mesh)
        for name in ("a.ply", "a.obj", "a.off", "a.stl", "a.gii", "a.gii.gz", "lh.white")
    },
    "a.nii": (lambda: _image(nibabel.Nifti1Image, False), read_volume),
    "a.nii.gz": (lambda: _image(nibabel.Nifti1Image, True), read_volume),
    "b.nii": (lambda: _image(nibabel.Nifti2Image, False), read_volume),
    "a.mgh": (lambda: _image(nibabel.MGHImage, False), read_volume),
    "a.mgz": (lambda: _image(nibabel.MGHImage, True), read_volume),
    "ddot.yaml": (
        lambda: (PACKAGE / "systems/settings/ddot/tiny.yaml").read_bytes(),
        lambda path: DeformationConfig.read(read_groups(path)),
    ),
    "segmentation.yaml": (lambda: (PACKAGE / "pipeline/settings/tiny.yaml").read_bytes(), read_segmentation_config),
    "recipe.yaml": (lambda: (PACKAGE / "synth/recipes/tiny.yaml").read_bytes(), read_recipe),
    "weights.safetensors": (
        lambda: _written("w.safetensors", lambda path: write_weights(path, SegmentationNetwork(2, 2), {"seed": 1})),
        lambda path: read_weights(path, SegmentationNetwork),
    ),
    "training.safetensors": (
        lambda: _written("t.safetensors", lambda path: write_training(path, training_state(), {"a": 1})),
        lambda path: read_training(path, training_state(), {"a": 1}),
    ),
    "fit.safetensors": (
        lambda: _written("f.safetensors", lambda path: write_training(path, fit_state(), {"a": 1})),
        lambda path: read_training(path, fit_state(), {"a": 1}),
    ),
    "velocity.safetensors.gz": (
        lambda: _written("v.safetensors.gz", lambda path: write_velocity(path, fit_state().network)),
        read_velocity,
    ),
    "results.json": (lambda: json.dumps({name: {"a": [1, 2.5]} for name in FIELDS}).encode(), read_results),
    "log.jsonl": (lambda: b'{"step": 1, "loss": 0.5}\n{"step": 2, "loss": 0.25}\n', read_log),
}


@functools.cache
def whole(name: str) -> bytes:
    """The whole file of a kind."""
    return KINDS[name][0]()
