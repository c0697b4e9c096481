"""``--device`` where the device is not there, and what is said if a GPU fails later."""

from argparse import Namespace

import pytest
import torch

from meshot.cli import reconstruct
from meshot.cli.common import device_errors, device_of
from meshot.cli.train import run_training

#: PyTorch tries to start CUDA once in a process: the pretended device of other tests may have answered for it.
NO_CUDA = "Torch not compiled with CUDA enabled|driver|No CUDA|Could not run"
needs_no_gpu = pytest.mark.skipif(torch.cuda.is_available(), reason="here is a GPU")


@needs_no_gpu
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("cuda", NO_CUDA),
        ("cuda:7", NO_CUDA),
        ("tpu", "Expected one of cpu, cuda"),
        ("meta", "it holds no numbers"),
        ("hpu", "."),
        ("xla", "Could not run"),
        ("", "must not be empty"),
        ("cuda:x", "Invalid device string"),
    ],
)
def test_what_cannot_compute_here_is_refused_in_one_line(name, reason):
    with pytest.raises(ValueError, match=rf"^--device {name}: PyTorch cannot compute there \(.*({reason})") as found:
        device_of(Namespace(device=name))
    said = str(found.value)
    assert said.endswith("; use cpu")
    assert "\n" not in said
    assert len(said) < 300


def test_the_processor_and_no_choice_are_taken():
    assert device_of(Namespace(device=None)) is None
    assert device_of(Namespace(device="cpu")) == torch.device("cpu")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB. GPU 0 has a total of 4 GiB."),
            r"^the memory of the GPU is full \(CUDA out of memory\); .* fewer --jobs, or use --device cpu$",
        ),
        (
            torch.AcceleratorError("CUDA error: an illegal memory access\nCUDA kernel errors might be reported later"),
            r"^the GPU reports an error \(CUDA error: an illegal memory access\); try once more, or use --device cpu$",
        ),
    ],
)
def test_a_gpu_that_fails_is_named_and_the_way_out(error, words):
    def fail():
        raise error

    with pytest.raises(ValueError, match=words), device_errors():
        fail()
    with pytest.raises(ValueError, match=words):
        run_training(Namespace(threads=None), fail)


def test_a_full_gpu_ends_a_reconstruction_with_exit_status_2(monkeypatch, tmp_path, capsys):
    from meshot.cli import main

    def full(_):
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB.")

    monkeypatch.setattr(reconstruct, "_networks", full)
    assert main(["reconstruct", "scan.nii.gz", "-o", str(tmp_path / "out")]) == 2
    assert "meshot: the memory of the GPU is full (CUDA out of memory); " in capsys.readouterr().err
