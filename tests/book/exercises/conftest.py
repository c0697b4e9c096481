"""What the tests of exercises share."""

import pytest


@pytest.fixture
def hinted(capsys):
    """Require that a checker refuses a function with this hint, and says the same when it is asked again."""

    def require(checker, function, hint):
        checker(function)
        said = capsys.readouterr().out
        assert said.startswith("✗")
        assert hint in said
        checker(function)
        assert capsys.readouterr().out == said

    return require
