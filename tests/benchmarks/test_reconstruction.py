"""The benchmark of a reconstruction, with its stages in place of the real ones."""

from types import SimpleNamespace

from meshot.provenance import read_results


def row(part, seconds):
    return {"part": part, "CPU s": seconds, "wall s": seconds}


def test_what_was_asked_for_is_judged(part, tmp_path, monkeypatch):
    module = part("reconstruction")
    monkeypatch.setattr(module, "whole", lambda initial_only: [row("registration", 50.0), row(module.WHOLE, 61.0)])
    monkeypatch.setattr(module, "flow", lambda name: row(module.FLOW.format(name), 4.0 if name == "small" else 5.5))
    assert module.main(["--repeats", "2", "-o", str(tmp_path / "found.json")]) == 0
    results = read_results(tmp_path / "found.json")["results"]
    assert [line["met"] for line in results["targets"]] == [False, True, False]
    assert [line["found_s"] for line in results["targets"]] == [61.0, 4.0, 5.5]
    block = part("speed_page").reconstruction_block(read_results(tmp_path / "found.json"))
    assert "within 60 s (missed); flow alone, small, within 5 s (met)" in block
    assert module.main(["--repeats", "1", "--initial-only", "-o", str(tmp_path / "found.json")]) == 0
    without = part("speed_page").reconstruction_block(read_results(tmp_path / "found.json"))
    assert ["without the flow" in each for each in (block, without)] == [False, True]
    assert block.splitlines()[-1] == "| flow alone, paper | 5.5 | 5.5 |"


def test_the_flow_moves_every_vertex_of_the_size_asked_for(part, monkeypatch):
    module, seen = part("reconstruction"), []
    monkeypatch.setattr(module, "standard_scan", lambda scan, _: SimpleNamespace(volume=scan))  # not registered
    deformed = module.deformed
    monkeypatch.setattr(module, "deformed", lambda *given: seen.append((given[0], deformed(*given))))
    assert module.flow("tiny")["wall s"] > 0
    ((start, end),) = seen
    assert len(start.vertices) == 40_962
    assert float((end.vertices - start.vertices).norm(dim=1).median()) > 0.3
