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


def test_a_book_takes_the_place_of_the_one_before_unless_a_warning_stops_it(render_page, tmp_path, capfd):
    page = tmp_path / "into" / "html" / "index.html"
    for text, shown, status, said in (
        ("first", "first", 0, str(page)),
        ("second", "second", 0, str(page)),
        (":ref:`nowhere`", "second", 1, "the book was not rendered"),
    ):
        assert render_page(f"A title\n=======\n\n{text}\n") == status
        assert shown in page.read_text(encoding="utf-8")
        assert [path.name for path in (tmp_path / "into").iterdir()] == ["html"]
        assert said in capfd.readouterr().out


def test_a_chapter_that_was_not_run_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(build, "ROOT", tmp_path)
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "book").mkdir()
    (tmp_path / "notebooks" / "01_a.md").write_text("# A\n")
    assert build.build("stored", tmp_path / "into") == 1
    assert "run the notebooks first" in capsys.readouterr().out
