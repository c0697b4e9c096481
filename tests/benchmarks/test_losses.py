"""The benchmark: what it says of its numbers, one small case of it, its pins, and the table in README."""

import re
import tomllib

import pytest
import yaml
from packaging.requirements import Requirement

from refusals import refuses


@pytest.fixture
def config(root):
    return yaml.safe_load((root / "experiments" / "cost" / "config.yaml").read_text(encoding="utf-8"))


def test_our_own_peers_run(part, config):
    peers, timing = part("peers"), part("timing")
    ours = [
        name for name in peers.PEERS if "GeomLoss lazy" not in name and "multiscale" not in name and "OTT" not in name
    ]
    small = config | {"n_directions": 3, "n_rounds": 2, "faces": {60: 1280}}
    cases = [timing.measured_time(name, 60, 6, small) for name in ours]
    assert [row["peer"] for row in cases] == ours
    assert not any("why" in row for row in cases)
    assert all(row["low"] <= row["seconds"] <= row["high"] for row in cases)


def test_a_peer_that_fails_is_noted(part, config, monkeypatch):
    peers, timing = part("peers"), part("timing")

    def broken(*_):
        raise RuntimeError("no such kernel")

    monkeypatch.setitem(peers.PEERS, peers.DENSE, peers.Peer(broken))
    row = timing.measured_time(peers.DENSE, 50, 3, config)
    assert row == {"peer": peers.DENSE, "d": 3, "m": 50, "why": "RuntimeError: no such kernel"}


def test_every_peer_has_a_warm_loop_of_its_own(part, config, monkeypatch):
    """One call to warm up, then all that count, before another peer is called."""
    peers, timing = part("peers"), part("timing")
    said = []
    monkeypatch.setattr(timing, "compile_for", lambda *_: None)
    for name in (peers.OURS, peers.POT):
        monkeypatch.setitem(peers.PEERS, name, peers.Peer(lambda *_, name=name: lambda: said.append(name)))
    cases = [timing.measured_time(name, 50, 3, config | {"n_rounds": 3}) for name in (peers.OURS, peers.POT)]
    assert said == [peers.OURS] * 4 + [peers.POT] * 4
    assert [row["rounds"] for row in cases] == [3, 3]


def test_a_higher_ceiling_runs_only_what_was_left_out(part, config, monkeypatch, tmp_path):
    peers, timing, losses = part("peers"), part("timing"), part("losses")
    said = []

    def measured(name, m, d, _):
        said.append((name, m))
        return {"peer": name, "d": d, "m": m, "rounds": 1, "seconds": 1e-3 * m, "low": 0.0, "high": 1.0}

    monkeypatch.setattr(peers, "prepare", dict)
    monkeypatch.setattr(timing, "measured_time", measured)
    monkeypatch.setattr(peers, "PEERS", {peers.POT: peers.PEERS[peers.POT]})
    small = config | {"sizes": [1000, 10_000, 100_000], "memory_sizes": [], "dimensions": [3]}
    results = losses.run(small, tmp_path / "partial.jsonl")
    assert said == [(peers.POT, 1000), (peers.POT, 10_000)]
    assert results["stopped"][0]["why"] == "time: 100 s foretold"
    losses.run(small | {"longest": 200.0}, tmp_path / "partial.jsonl")
    assert said[2:] == [(peers.POT, 100_000)]
    losses.run(small | {"longest": 200.0, "n_rounds": 2}, tmp_path / "partial.jsonl")
    assert len(said) == 6


def test_who_would_take_too_long_or_too_much_is_left_out(part, config):
    peers, timing = part("peers"), part("timing")
    past = [{"peer": peers.BRUTE, "m": m, "seconds": 1e-7 * m**2} for m in (1000, 10_000)]
    assert timing.reason_to_stop(peers.BRUTE, 11_000, past, config) == ""
    assert timing.reason_to_stop(peers.BRUTE, 30_000, past, config).startswith("time: 90 s")
    assert timing.reason_to_stop(peers.DENSE, 3000, [], config) == ""
    assert timing.reason_to_stop(peers.DENSE, 100_000, [], config).startswith("memory")


def test_exponents_and_targets(part):
    peers, summary = part("peers"), part("summary")
    growth = {peers.OURS: (1e-6, 1.1), peers.POT: (4e-5, 1.1), peers.TREE: (1e-6, 1.1), peers.FLOOR: (1e-6, 1.1)}
    cases = [
        {"peer": peer, "d": d, "m": m, "seconds": factor * m**power}
        for peer, (factor, power) in growth.items()
        for d in (3, 6)
        for m in (1000, 10_000, 100_000, 1_000_000)
    ]
    memory = [{"peer": peers.OURS, "d": 6, "m": 1_000_000, "bytes": 290e6}]
    found = summary.exponents(cases, memory)
    assert all(row["exponent"] == pytest.approx(1.1) and row["from"] == 10_000 for row in found)
    by_name = {row["what"]: row for row in summary.targets(cases, memory)}
    assert by_name["times faster than POT, m = 10000, d = 3"]["found"] == pytest.approx(40)
    assert by_name["times faster than POT, m = 100000, d = 6"]["met"]
    assert by_name["time over k-d-tree Chamfer, m = 100000, d = 3"]["met"]
    assert by_name["time over k-d-tree Chamfer, m = 100000, d = 6"]["met"] is False
    assert by_name["growth of time from m = 10000 to 1000000, exponent, d = 6"]["found"] == pytest.approx(1.1)
    assert by_name["memory above the inputs, m = 1000000, d = 6"]["found"] == pytest.approx(290)
    assert by_name[f"{peers.VALUE}, 20480 faces each side, d = 3"]["met"] is None


def test_pins_are_exact_and_outside_the_lock(root):
    lines = (root / "benchmarks" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pinned = [Requirement(line) for line in lines if line and not line.startswith("#")]
    assert {"ott-jax", "jax", "jaxlib", "pykeops"} <= {requirement.name for requirement in pinned}
    assert all(re.fullmatch(r"==[\d.]+", str(requirement.specifier)) for requirement in pinned)
    locked = (root / "requirements.lock").read_text(encoding="utf-8").lower()
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for requirement in pinned:
        assert f"\n{requirement.name.lower()}==" not in locked
        assert not any(Requirement(line).name == requirement.name for line in project["dependencies"])


def test_the_page_shows_the_committed_results(root, part):
    speed_page = part("speed_page")
    text = (root / "book" / "speed.md").read_text(encoding="utf-8")
    assert speed_page.written(text) == text, "book/speed.md disagrees with results: python benchmarks/speed_page.py"
    refuses("no <!-- ruler -->", speed_page.with_block, "nothing", "ruler", "block")
    assert speed_page.with_block("a\n<!-- x -->\nold\n<!-- /x -->\nb", "x", "new").splitlines()[2:3] == ["new"]
