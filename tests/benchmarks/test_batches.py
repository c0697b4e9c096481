"""The benchmark of batches, on clouds small enough to be quick."""

import torch

import meshot
from meshot.provenance import read_results


def test_all_parts_are_timed_and_compared(part, tmp_path):
    words = ["--pairs", "5", "--points", "40", "--sizes", "50", "60", "--repeats", "1", "--threads", "1"]
    assert part("batches").main([*words, "-o", str(tmp_path / "batches.json")]) == 0
    record = read_results(tmp_path / "batches.json")
    parts = {row["part"]: row["CPU s"] for row in record["results"]["parts"]}
    assert list(parts)[:4] == ["one call", "our loss in a loop", "POT in a loop", "PyTorch, the whole batch sorted"]
    assert list(parts)[4].endswith("batch of 4, times 1.25")
    assert all(seconds > 0 for seconds in parts.values())
    found = {row["what"]: row for row in record["results"]["targets"]}
    assert found["POT in a loop, batch"]["found"] == parts["POT in a loop"] / parts["one call"]
    assert [row["at_least"] for row in found.values()] == [20, 4, 25, 40]
    assert found["POT, one pair of 60"]["met"] == (found["POT, one pair of 60"]["found"] >= 40)


def test_all_sliced_losses_of_the_benchmark_are_the_same(part):
    module, x, y = part("batches"), torch.randn(3, 20, 3).double(), torch.randn(3, 20, 3).double()
    lines = meshot.random_directions(30, 3, 0)
    ours = meshot.sliced_wasserstein(x, y, lines)
    torch.testing.assert_close(module.batched_sort(x, y, lines), ours)
    torch.testing.assert_close(torch.stack([module.pot(a, b, lines) for a, b in zip(x, y)]), ours)
