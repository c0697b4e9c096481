"""The picture of a training's log."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot.view.page import training_figure, write_training_figure
from refusals import refuses

LOG = [{"step": i, "loss": 1 / i, "learning_rate": 0.1} for i in range(1, 61)]
CHECK = {"step": 60, "validation_loss": 0.2, "dice_left": 0.9, "dice_right": 0.8, "cpu_seconds": 1.0}


def test_lines_are_those_of_the_log():
    figure = training_figure([*LOG, CHECK])
    loss, overlap = figure.axes
    by_name = {line.get_label(): line for line in (*loss.lines, *overlap.lines)}
    assert by_name["one step"].get_ydata().tolist() == [1 / i for i in range(1, 61)]
    assert by_name["mean of 2 steps"].get_xdata()[0] == 2
    assert by_name["mean of 2 steps"].get_ydata()[0] == pytest.approx(0.75)
    assert by_name["validation"].get_xydata().tolist() == [[60, 0.2]]
    assert by_name["left"].get_ydata().tolist() == [0.9]
    assert by_name["right"].get_ydata().tolist() == [0.8]
    assert loss.get_yscale() == "log"
    plt.close(figure)


@pytest.mark.parametrize(("lowest", "said"), [(0.3, {"0.2", "0.5", "1", "2"}), (0.0005, {"0.001", "0.01", "0.1", "1"})])
def test_ticks_of_the_loss_are_plain_numbers_and_steps_are_whole(lowest, said):
    losses = np.geomspace(2.0, lowest, 16)
    log = [{"step": k, "loss": loss} for k, loss in enumerate(losses, 1)]
    figure = training_figure([*log, CHECK | {"step": 16}])
    figure.draw_without_rendering()
    loss, overlap = figure.axes
    low, high = loss.get_ylim()
    shown = {text.get_text() for text in loss.get_yticklabels() if low <= text.get_position()[1] <= high}
    assert shown == said
    assert all(float(text.get_text()).is_integer() for text in overlap.get_xticklabels())
    assert loss.get_position().y0 > overlap.get_position().y1  # one below the other
    plt.close(figure)


def test_any_other_validation_is_drawn_by_its_loss():
    figure = training_figure([*LOG, {"step": 60, "validation_loss": 0.2, "seconds_of_its_own": 3.0}])
    loss, right = figure.axes
    assert [line.get_xydata().tolist() for line in right.lines] == [[[60, 0.2]]]
    assert loss.get_ylabel() == "loss"
    plt.close(figure)


def test_a_picture_is_written_and_an_empty_log_refused(tmp_path):
    write_training_figure(tmp_path / "a.png", LOG)
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    refuses("holds no step", training_figure, [CHECK])
