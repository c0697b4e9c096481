"""Storage of one hemisphere in one small file: scan, initial and true surface, quantised."""

import json
import os
import zlib

import numpy as np
import safetensors
import safetensors.numpy
import torch

from meshot.files import whole_file
from meshot.mesh import Mesh, simplified
from meshot.systems import DeformationExample
from meshot.types import Array, Tensor
from meshot.volume import Volume, mm_to_voxel

LARGEST_BYTES = 1_500_000
_GREYS, _STEPS = 255, 65_535
#: Voxels kept around the surfaces, and block size: as the cubes of a network with three scales require.
_MARGIN, _BLOCK = 12, 4


def write_example(
    path: str | os.PathLike, example: DeformationExample, record: dict, n_target_faces: int = 30_000
) -> None:
    """Write a hemisphere with at most 65 536 vertices, completely or not at all."""
    # The part of the scan that can influence a flow near the surfaces.
    volume, shape = example.scan, np.array(example.scan.data.shape)
    places = mm_to_voxel(volume, torch.cat([example.initial.vertices, example.target.vertices]).double()).numpy()
    low = np.clip((np.floor(places.min(axis=0)).astype(int) - _MARGIN) // _BLOCK * _BLOCK, 0, None)
    high = np.minimum(-(-(np.ceil(places.max(axis=0)).astype(int) + _MARGIN) // _BLOCK) * _BLOCK, shape)
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ low
    scan = Volume(volume.data[tuple(slice(a, b) for a, b in zip(low, high, strict=True))], affine)
    if scan.data.min() < 0 or scan.data.max() > 1:
        raise ValueError(f"the scan ranges from {scan.data.min():.4g} to {scan.data.max():.4g}; [0, 1] is needed")
    greys = zlib.compress(np.round(scan.data * _GREYS).astype(np.uint8).tobytes(), 9)
    tensors = {
        "scan_zlib": np.frombuffer(greys, np.uint8),
        "scan_shape": np.array(scan.data.shape),
        "scan_affine": scan.affine,
    }
    for name, mesh in (("initial", example.initial), ("target", simplified(example.target, n_target_faces))):
        tensors |= _packed(name, mesh)
    n_bytes = sum(value.nbytes for value in tensors.values())
    if n_bytes > LARGEST_BYTES:
        raise ValueError(
            f"the hemisphere takes {n_bytes / 1e6:.2f} MB; at most {LARGEST_BYTES / 1e6:.1f} MB are kept: simplify the "
            "surfaces"
        )
    metadata = {"DeformationExample": json.dumps(record | {"name": example.name}, allow_nan=False)}
    with whole_file(path) as temporary:
        safetensors.numpy.save_file({k: np.ascontiguousarray(v) for k, v in tensors.items()}, temporary, metadata)


def read_example(path: str | os.PathLike) -> tuple[DeformationExample, dict]:
    """Read a hemisphere and its record. ``coarse`` is the same mesh as ``initial``."""
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            record = json.loads((file.metadata() or {})["DeformationExample"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
        greys = np.frombuffer(zlib.decompress(tensors["scan_zlib"].tobytes()), np.uint8)
        data = greys.reshape(tensors["scan_shape"]).astype(np.float32) / _GREYS
        scan = Volume(data, tensors["scan_affine"])
        initial, target = (_unpacked(name, tensors) for name in ("initial", "target"))
    except (OSError, safetensors.SafetensorError, KeyError, ValueError, zlib.error) as error:
        raise ValueError(
            f"{os.fspath(path)} does not hold a hemisphere ({error}); make one with write_example"
        ) from error
    return DeformationExample(record["name"], scan, initial, initial, target), record


def _packed(name: str, mesh: Mesh) -> dict[str, Array]:
    if len(mesh.vertices) > _STEPS + 1:
        raise ValueError(
            f"the {name} mesh has {len(mesh.vertices)} vertices; at most {_STEPS + 1} are kept: simplify it"
        )
    vertices = mesh.vertices.detach().cpu().double().numpy()
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return {
        f"{name}_vertices": np.round((vertices - low) / (high - low) * _STEPS).astype(np.uint16),
        f"{name}_faces": mesh.faces.cpu().numpy().astype(np.uint16),
        f"{name}_box": np.stack([low, high]),
    }


def _unpacked(name: str, tensors: dict[str, Array]) -> Mesh:
    low, high = tensors[f"{name}_box"]
    vertices = low + tensors[f"{name}_vertices"] / _STEPS * (high - low)
    return Mesh(_tensor(vertices.astype(np.float32)), _tensor(tensors[f"{name}_faces"].astype(np.int64)))


def _tensor(values: Array) -> Tensor:
    return torch.from_numpy(values)
