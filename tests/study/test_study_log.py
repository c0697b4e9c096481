"""What a reconstruction says and where it computes: the log of a study, more words or none, and the device."""

import re

import pytest

from bids_trials import network_words
from meshot.cli import main
from meshot.pipeline import load_networks, report as report_files, seconds_by_stage
from meshot.study.bids import visits_of_bids
from meshot.study.many_visits import reconstruct_study


def test_the_seconds_of_the_stages_and_their_sum():
    assert seconds_by_stage({"one": 1.25, "two stages": 2.0}) == "one 1.2 s, two stages 2.0 s, total 3.2 s"


def test_the_log_has_a_line_for_each_visit_of_each_run(tmp_path, dataset, settings, quick):
    lines = []
    for _ in range(2):
        visits = visits_of_bids(dataset)
        reconstruct_study(visits, tmp_path / "study", settings, tell=lines.append, detail=True)
    log = (tmp_path / "study" / "logs" / "meshot.log").read_text(encoding="utf-8").splitlines()
    assert len(log) == 2 * (1 + 4 + 1)
    assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ ", line) for line in log)
    said = [line.split(" ", 1)[1] for line in log]
    assert said[0].endswith("4 visits, layout flat, 1 processes")
    assert said[5] == "3 done, 1 failed"
    assert said[1:5] + said[7:11] == [" ".join(line.split()) for line in lines]
    assert lines[4] == "sub-01_ses-a: done by an earlier run"
    assert re.match(
        r"sub-01_ses-a: done, with warnings: group_average.* \(registration [\d.]+ s, .*total [\d.]+ s\)$",
        lines[0],
    )


@pytest.mark.parametrize("single", [True, False])
def test_quiet_says_only_what_is_wrong_and_verbose_says_more(
    tmp_path, dataset, settings, quick, found, monkeypatch, capsys, single
):
    monkeypatch.setattr(report_files, "reconstruct", lambda *_: found)
    scan = str(dataset / "sub-02/anat/sub-02_T1w.nii.gz") if single else str(dataset)
    words = ["reconstruct", scan, *network_words(settings), *([] if single else ["--participant-label", "02", "03"])]
    expected = 0 if single else 1
    for name, option in (("a", "--quiet"), ("b", "--verbose")):
        assert main([*words, "-o", str(tmp_path / name), option]) == expected
        said = capsys.readouterr()
        if option == "--quiet":
            assert said.out == ""
            assert all(line.startswith("meshot: warning: ") for line in said.err.splitlines())
            assert single or "sub-03 failed; the reason is in " in said.err
        else:
            assert re.search(r"pictures [\d.]+ s, total [\d.]+ s", said.out)
    with pytest.raises(SystemExit):
        main([*words, "-o", str(tmp_path / "c"), "--quiet", "--verbose"])


def test_a_device_that_is_not_there_is_refused_before_the_first_scan(tmp_path, dataset, settings, capsys):
    words = ["reconstruct", str(dataset), "-o", str(tmp_path / "out"), *network_words(settings), "--device"]
    assert main([*words, "nothing"]) == 2
    assert "--device nothing: " in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_networks_go_to_the_device_that_is_chosen(settings):
    """The device meta holds no numbers, and every machine has it."""
    networks = load_networks("ddot", settings.weights, settings.segmentation, device="meta")
    parts = [networks.segmentation, *(part.network for part in networks.system.parts.values())]
    assert {parameter.device.type for part in parts for parameter in part.parameters()} == {"meta"}
