"""The teaching guide names every chapter and its exercises as they are."""

import re

import pytest

from editions import board_notes


@pytest.fixture(scope="module")
def sections(request) -> dict[str, str]:
    """The sections of the guide, by heading."""
    text = (request.config.rootpath / "book" / "teaching.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (.*)$", text, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def chapters(root) -> dict[str, str]:
    return {path.stem[:2]: path.read_text(encoding="utf-8") for path in sorted((root / "notebooks").glob("[0-9]*.md"))}


def test_objectives_name_the_exercises_of_every_chapter(root, sections):
    rows = dict(re.findall(r"^\| (\d\d) \| .* \| (.*) \|$", sections["Objectives and exercises"], re.M))
    expected = {}
    for number, text in chapters(root).items():
        stars = re.findall(r"^### .*?(★+)", text, re.M)
        expected[number] = (
            f"all four exercises of chapter {int(number)}"
            if len(stars) == 4
            else (f"{' '.join(sorted(stars))} of chapter {int(number)}")
        )
    assert rows == expected


def test_every_live_figure_has_a_line_for_the_lecturer(root, sections):
    live = {number for number, text in chapters(root).items() if re.search(r"^live_figure\(", text, re.M)}
    assert len(live) >= 6
    assert set(re.findall(r"^\| (\d\d) \| .{40,} \|$", sections["Live figures"], re.M)) == live


def test_every_chapter_has_a_drawing_and_a_place_in_a_course(root, sections):
    every = set(chapters(root))
    assert set(board_notes((root / "book" / "teaching.md").read_text(encoding="utf-8"))) == every
    assert set(map(int, re.findall(r"\b\d+\b", sections["Courses"]))) >= set(map(int, every))


def test_points_of_an_exam_question_add_up(sections):
    text = sections["Exam questions"]
    parts = re.findall(r"^\*\*Question \d+\*\* \((\d+) points.*?\*([A-Z][^*]*)\.\*\n:::", text, re.M | re.S)
    assert len(parts) == 10
    for points, shares in parts:
        assert sum(map(int, re.findall(r"\d+", shares))) == int(points)
    assert f"They give {sum(int(points) for points, _ in parts)} points together." in text
