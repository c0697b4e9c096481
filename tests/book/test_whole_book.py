"""The rendered book is whole or as it was: it is made aside, and takes its place at the end."""

import pytest

import build


@pytest.fixture
def render_page(monkeypatch, tmp_path):
    """Render a book of one page into a folder; the exit status."""

    def run(page: str) -> int:
        def assemble(notebooks, source):
            source.mkdir(parents=True)
            (source / "conf.py").write_text("project = 'small'\n")
            (source / "index.rst").write_text(page)

        monkeypatch.setattr(build, "assemble", assemble)
        return build.build("stored", tmp_path / "into")

    return run


def test_a_book_takes_the_place_of_the_one_before_and_leaves_nothing_else(render_page, tmp_path, capfd):
    for word in ("first", "second"):
        assert render_page(f"A title\n=======\n\n{word}\n") == 0
        html = tmp_path / "into" / "html"
        assert word in (html / "index.html").read_text(encoding="utf-8")
        assert [path.name for path in (tmp_path / "into").iterdir()] == ["html"]
        assert str(html / "index.html") in capfd.readouterr().out


def test_the_book_before_stays_if_a_warning_stops_the_new_one(render_page, tmp_path, capfd):
    assert render_page("A title\n=======\n\nsound\n") == 0
    assert render_page("A title\n=======\n\n:ref:`nowhere`\n") == 1
    assert "the book was not rendered" in capfd.readouterr().out
    html = tmp_path / "into" / "html"
    assert "sound" in (html / "index.html").read_text(encoding="utf-8")
    assert [path.name for path in (tmp_path / "into").iterdir()] == ["html"]


def test_a_chapter_that_was_not_run_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(build, "ROOT", tmp_path)
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "book").mkdir()
    (tmp_path / "notebooks" / "01_a.md").write_text("# A\n")
    assert build.build("stored", tmp_path / "into") == 1
    assert "run the notebooks first" in capsys.readouterr().out
