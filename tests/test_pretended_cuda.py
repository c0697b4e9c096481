"""The pretended CUDA device finds planted mistakes, and lets pass what a real one takes."""

import copy

import numpy as np
import pytest
import torch

from pretended_cuda import CUDA, CudaGenerator, CudaTensor, pretended_cuda
from pretended_cuda_rules import unchecked_operations

SAME = "Expected all tensors to be on the same device"
GRID = torch.nn.functional.grid_sample

#: Code with x = [0, 1, 2, 3] on the device and c = [1, 1, 1, 1] on the processor -> the words of the error.
REFUSED = {
    "x + c": SAME,
    "c + x": SAME,
    "c.add_(x)": SAME,
    "c.sum().add_(x.sum())": SAME,
    "c.sum().mul_(x.sum())": SAME,
    "torch.cat([x, c])": SAME,
    "torch.stack([x.sum(), c.sum()])": SAME,
    "x @ c": SAME,
    "torch.addcmul(x, c.sum(), c.sum())": SAME,
    "torch.where(c > 0, x, 0.0)": SAME,
    "x.masked_fill(c > 0, 0.0)": SAME,
    "x.index_select(0, torch.tensor([1]))": SAME,
    "x.gather(0, torch.tensor([1]))": SAME,
    "x.index_add(0, torch.tensor([1]), x[:1])": SAME,
    "x.index_put((torch.tensor([1]),), c[:1])": SAME,
    "torch.searchsorted(x, c.sum())": SAME,
    "torch.equal(x, c)": SAME,
    "torch.linalg.lstsq(x[:, None], c[:, None])": SAME,
    "GRID(x.view(1, 1, 2, 2), torch.zeros(1, 1, 1, 2), align_corners=False)": SAME,
    "torch.nn.Linear(4, 2)(x)": SAME,
    "torch.nn.Linear(4, 2).to('cuda')(c)": SAME,
    "c[x.long()]": "indices should be either on cpu or on the same device as the indexed tensor",
    "x.long() @ x.long()": "not implemented for torch.int64",
    "torch.ones(2, 4, dtype=int, device='cuda') @ x.long()": "not implemented for torch.int64",
    "torch.addmm(x.view(2, 2).int(), x.view(2, 2).int(), x.view(2, 2).int())": "not implemented for torch.int32",
    "x.numpy()": "can't convert cuda:0 device type tensor to numpy",
    "np.asarray(x)": "can't convert cuda:0 device type tensor to numpy",
    "np.from_dlpack(x)": "can't convert cuda:0 device type tensor to numpy",
    "x.data_ptr()": "can't convert cuda:0 device type tensor",
    "torch.zeros(2, device='cuda:7')": "invalid device ordinal",
    "c.to('cuda:1')": "invalid device ordinal",
    "torch.rand(2, device='cuda', generator=torch.Generator())": "Expected a 'cuda' device type for generator",
    "torch.rand(2, generator=CudaGenerator())": "Expected a 'cpu' device type for generator",
}

#: Code -> whether the result is on the device.
TAKEN = {
    "x + c.sum()": True,
    "c.sum() + x": True,
    "x * 2.0": True,
    "x.clone().mul_(c.sum())": True,
    "x[torch.tensor([1, 2])]": True,
    "x.clone().index_put_((torch.tensor([1]),), c.sum())": True,
    "torch.where(x > 1, c.sum(), c.sum())": True,
    "x.clone().copy_(c)": True,
    "c.clone().copy_(x)": False,
    "c.to('cuda')": True,
    "c.to(x.device)": True,
    "c.to(x)": True,
    "c.cuda()": True,
    "x.cpu()": False,
    "x.to('cpu', torch.float64)": False,
    "x.double()": True,
    "x.new_tensor([1.0])": True,
    "torch.zeros_like(x)": True,
    "torch.tensor([1.0], device='cuda')": True,
    "torch.as_tensor(np.ones(2), device=torch.device('cuda', 0))": True,
    "torch.arange(3, device='cuda:0')": True,
    "torch.arange(3)": False,
    "torch.rand(2, device='cuda', generator=CudaGenerator())": True,
    "torch.einsum('i,i->', x, x)": True,
    "(x.long() * x.long()).sum()": True,
    "c.long() @ c.long()": False,
    "torch.tensor(x.tolist())": False,
    "torch.tensor(float(x.sum()))": False,
    "copy.deepcopy(torch.nn.Linear(4, 2).to('cuda'))(x)": True,
    "torch.nn.Linear(4, 2).to('cuda').cpu()(c)": False,
}


@pytest.mark.parametrize("code", REFUSED)
def test_planted_mistakes_are_found(code):
    with torch.no_grad(), pretended_cuda(), pytest.raises((RuntimeError, TypeError), match=REFUSED[code]):
        run(code)


@pytest.mark.parametrize("code", TAKEN)
def test_what_cuda_takes_is_taken(code):
    with torch.no_grad(), pretended_cuda():
        found = run(code)
        assert found.device == (CUDA if TAKEN[code] else torch.device("cpu"))
        assert isinstance(found, CudaTensor) == TAKEN[code]


def run(code: str) -> torch.Tensor:
    """The value of one line of code."""
    names = {"x": torch.arange(4.0, device="cuda"), "c": torch.ones(4), "CudaGenerator": CudaGenerator, "GRID": GRID}
    return eval(code, names | {"torch": torch, "np": np, "copy": copy})


def test_numbers_are_those_of_the_processor_and_operations_are_counted():
    with torch.no_grad(), pretended_cuda() as operations:
        assert torch.cuda.is_available()
        x = torch.linspace(0, 1, 5).to("cuda")
        y = x.unsqueeze(0).squeeze_(0)
        y[1:3].mul_(2.0)  # through a view
        found = (y.sin() @ x).cpu()
        assert operations["aten.sin.default"] == 1
    expected = torch.linspace(0, 1, 5)
    expected[1:3] *= 2
    assert torch.equal(found, expected.sin() @ expected)


def test_nothing_stays_after_the_block():
    with pretended_cuda():
        pass
    assert not torch.cuda.is_available() or torch.version.cuda
    assert type(torch.ones(2) + torch.ones(2)) is torch.Tensor
    assert torch.ones(2, requires_grad=True).sum().item() == 2


def test_the_exceptions_come_from_the_list_of_pytorch():
    names = unchecked_operations()
    assert {"aten::add.Tensor", "aten::where.self", "aten::index.Tensor"} <= names
    assert not names & {"aten::cat", "aten::mm", "aten::gather", "aten::searchsorted.Tensor"}
