"""What holds for every checker, whatever its exercise: an empty stub and something else than a function fail."""

import pytest

from meshot_book.exercises import check


def stub(*_):
    raise NotImplementedError


@pytest.mark.parametrize("name", check.__all__)
@pytest.mark.parametrize(("given", "hint"), [(stub, "nothing is written yet"), (3, "a function is needed")])
def test_what_is_no_answer_is_told_so(hinted, name, given, hint):
    hinted(getattr(check, name), given, hint)
