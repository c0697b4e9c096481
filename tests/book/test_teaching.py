"""The teaching guide names every chapter, its exercises as they are, and hours that add up."""

import re

import pytest


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
            f"all four exercises of chapter {number}"
            if len(stars) == 4
            else (f"{' '.join(sorted(stars))} of chapter {number}")
        )
    assert rows == expected


def test_every_chapter_has_a_drawing_a_place_in_a_course_and_a_correction(root, sections):
    every = set(chapters(root))
    assert set(re.findall(r"^- \*\*(\d\d)\*\*", sections["On the board"], re.M)) == every
    assert set(re.findall(r"\b\d\d\b", sections["Courses"])) >= every
    corrected = set(re.findall(r"\b\d\d\b", sections["Common misconceptions"]))
    assert corrected <= every
    assert len(corrected) >= 8


def test_hours_add_up(sections):
    rows = dict(re.findall(r"^\| (\d+) \| .*? \| (.*) \|$", sections["Courses"], re.M))
    assert sum(map(int, re.findall(r"(\d+) min", rows["4"]))) == 4 * 60
    n_eight = len(re.findall(r"\b\d\d\b", rows["8"].split(", of")[0]))
    assert 0 <= 8 * 60 - 90 * n_eight <= 30
    assert 80 * len(re.findall(r"\b\d\d\b", rows["12"].split(", of")[0])) == 12 * 60


def test_every_exam_question_has_its_chapter(sections):
    exam = sections["Exam questions"]
    questions = re.findall(r"^\d+\. ", exam, re.M)
    answered = re.search(r"^\| chapter (.*)\|$", exam, re.M)[1]
    assert len(re.findall(r"\d\d", answered)) == len(questions) == 10
