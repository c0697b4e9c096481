"""Every name at the front door has an example in its docstring, and it runs."""

import doctest

import pytest

import meshot
from house import shown_names

ROOT_STUB = "src/meshot/__init__.pyi"


def examples_of(thing: object, name: str) -> doctest.DocTest:
    return doctest.DocTestParser().get_doctest(thing.__doc__ or "", {}, name, None, 0)


def failures(test: doctest.DocTest) -> list[str]:
    """What every example that fails printed, and what was expected; or that there is none."""
    if not test.examples:
        return [f"{test.name} has no example: add a section Examples to its docstring"]
    said: list[str] = []
    doctest.DocTestRunner(verbose=False).run(test, out=said.append)
    return said


def pytest_generate_tests(metafunc):
    if "public_name" in metafunc.fixturenames:
        names = [n for n in shown_names(metafunc.config.rootpath / ROOT_STUB) if not n.startswith("_")]
        assert len(names) > 20
        metafunc.parametrize("public_name", names)


def test_the_example_runs(public_name):
    assert failures(examples_of(getattr(meshot, public_name), public_name)) == []


def without():
    """Nothing to run."""


def wrong():
    """A sum.

    Examples
    --------
    >>> 1 + 1
    3
    """


def raising():
    """An error.

    Examples
    --------
    >>> import meshot
    >>> meshot.chamfer(None, None)
    0.0
    """


@pytest.mark.parametrize(
    ("function", "words"), [(without, "without has no example"), (wrong, "Got:\n    2"), (raising, "source is None")]
)
def test_a_missing_or_wrong_example_is_seen(unchecked, function, words):
    assert any(words in said for said in failures(examples_of(function, function.__name__)))
