"""Logs of trainings: thinned for a curve, and counted while a training runs."""

from meshot_book.trainings.processes import steps_done, thinned


def test_a_thinned_log_keeps_means_and_validations():
    log = [{"step": i + 1, "loss": float(i), "learning_rate": 0.1} for i in range(12)]
    log.insert(8, {"step": 8, "validation_loss": 0.5, "cpu_seconds": 1.0})
    found = thinned(log, 3)
    assert [line["loss"] for line in found if "loss" in line] == [1.5, 5.5, 9.5]
    assert [line["step"] for line in found] == [4, 8, 8, 12]
    assert found[2] == log[8]
    assert thinned(log[:2], 3) == log[:2]


def test_steps_of_all_networks_are_counted(tmp_path):
    assert steps_done(tmp_path) == 0
    for name, n in (("left_white", 3), ("right_white", 2)):
        folder = tmp_path / "state" / name
        folder.mkdir(parents=True)
        (folder / "log.jsonl").write_text("{}\n" * n)
    assert steps_done(tmp_path) == 5
