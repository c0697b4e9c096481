"""Storage of a fitted velocity field in a small file, so that its flow can be applied to other meshes."""

import gzip
import json
import os
from pathlib import Path

import safetensors.torch
import torch

from meshot.compressed import unpacked
from meshot.files import whole_file
from meshot.flow.fields.grid import GridVelocity, single_level

#: Maximum size of a stored velocity field after decompression, in bytes.
LARGEST_BYTES = 1 << 28


def quantised_velocity(field: GridVelocity, step: float = 2.0**-5) -> GridVelocity:
    """The same field as one level on its finest grid, its coefficients rounded to multiples of ``step``.

    :func:`write_velocity` stores this field. Velocities change by at most half of ``step``, in mm per unit of time.

    Raises
    ------
    ValueError
        If ``step`` is not positive, or so small that the coefficients do not fit into 16 bits.
    """
    if not step > 0:
        raise ValueError(f"step is {step!r}; a positive number of mm per unit of time is needed")
    whole = (field.coefficients().detach() / step).round()
    if float(whole.abs().max()) > 32767:
        raise ValueError(f"coefficients reach {float(whole.abs().max()):.0f} steps of {step}; take a larger step")
    return single_level(whole * step, field.lower, field.spacings[-1], field.interpolation)


def write_velocity(path: str | os.PathLike, field: GridVelocity, step: float = 2.0**-5) -> None:
    """Write the coefficients on the finest grid as 16-bit multiples of ``step`` to a gzipped safetensors file.

    Raises
    ------
    ValueError
        If the suffix is not ``.safetensors.gz``, or as :func:`quantised_velocity`.
    """
    if not str(path).endswith(".safetensors.gz"):
        raise ValueError(f"{Path(path).name} does not end in .safetensors.gz; a path with this suffix is needed")
    coefficients = quantised_velocity(field, step).coefficients().detach()
    tensors = {
        # Component first: neighbouring values are then similar, and gzip saves a fifth of the bytes.
        "coefficients": (coefficients / step).round().to(torch.int16).movedim(-1, 0).contiguous(),
        "lower": field.lower.double().contiguous(),
    }
    header = {"step": step, "spacing": field.spacings[-1], "dtype": str(coefficients.dtype)}
    if field.interpolation != "cubic":  # files without this entry are cubic
        header["interpolation"] = field.interpolation
    with whole_file(path) as temporary:
        # A fixed time stamp in the header, so that the same field gives the same bytes.
        temporary.write_bytes(
            gzip.compress(safetensors.torch.save(tensors, {"velocity": json.dumps(header)}), compresslevel=9, mtime=0)
        )


def read_velocity(path: str | os.PathLike) -> GridVelocity:
    """Read a file of :func:`write_velocity`: a field of one level on the finest grid.

    Raises
    ------
    ValueError
        If the file is missing, truncated, or of another kind.
    """
    try:
        content = unpacked(path, LARGEST_BYTES)
        length = int.from_bytes(content[:8], "little")
        header = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["velocity"])
        tensors = safetensors.torch.load(content)
        dtype = {"torch.float32": torch.float32, "torch.float64": torch.float64}[header["dtype"]]
        values, lower = tensors["coefficients"].movedim(0, -1).to(dtype) * header["step"], tensors["lower"].to(dtype)
        return single_level(values, lower, header["spacing"], header.get("interpolation", "cubic"))
    except (
        OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RuntimeError, safetensors.SafetensorError
    ) as error:  # fmt: skip
        raise ValueError(
            f"{path} is not a complete velocity file ({error}); copy it again, or repeat the fit"
        ) from error
