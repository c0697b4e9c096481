"""Quizzes for learning platforms hold every question, its answers, which of them is right, and why."""

import html
import io
import re
import xml.etree.ElementTree as ET
import zipfile

import pytest

from quiz_extension import read_quiz
from quiz_files import quiz_files

QTI = "{http://www.imsglobal.org/xsd/imsqti_v2p1}"
#: The order in which the schema of QTI 2.1 asks for the parts of an item.
PARTS = ["responseDeclaration", "outcomeDeclaration", "outcomeDeclaration", "itemBody", "responseProcessing"]


@pytest.fixture(scope="module")
def files():
    return quiz_files()


@pytest.fixture(scope="module")
def quizzes(root):
    return {file.stem: read_quiz(file) for file in sorted((root / "book" / "quizzes").glob("*.yaml"))}


def letters(text: str) -> str:
    """The letters and digits of a text, without markup: formulas keep their names."""
    text = re.sub(r"\$[^$]*\$|\\\\?\(.*?\\\\?\)", "", html.unescape(re.sub(r"<[^>]*>", "", text)))
    return re.sub(r"\W", "", re.sub(r"\]\([^)]*\)|\{\w+(:\w+)?\}", "", text))


def unescaped(gift: str) -> str:
    return re.sub(r"\\(.)", r"\1", gift)


def test_gift_holds_every_question(files, quizzes):
    assert {name for name in files if name.endswith(".gift")} == {f"gift/{name}.gift" for name in quizzes}
    for name, questions in quizzes.items():
        head, *found = files[f"gift/{name}.gift"].strip().split("\n\n")
        assert head == f"$CATEGORY: Meshes as Measures/{name}"
        for number, (text, question) in enumerate(zip(found, questions, strict=True), 1):
            asked, *answers, end = text.split("\n")
            assert end == "}"
            assert asked.startswith(f"::{name} {number}::[html]")
            assert asked.endswith("{")
            assert letters(unescaped(asked.split("[html]")[1])) == letters(str(question["question"]))
            for line, answer in zip(answers, question["answers"], strict=True):
                sign, words, because = re.fullmatch(
                    r"\t([=~])((?:[^\\~=#{}:]|\\.)*)#((?:[^\\~=#{}:]|\\.)*)", line
                ).groups()
                assert (sign == "=") == bool(answer.get("right"))
                assert letters(unescaped(words)) == letters(str(answer["answer"]))
                assert letters(unescaped(because)) == letters(str(answer["because"]))


def test_qti_holds_every_question(files, quizzes):
    package = zipfile.ZipFile(io.BytesIO(files["meshes_as_measures_qti.zip"]))
    manifest = ET.fromstring(package.read("imsmanifest.xml"))
    listed = [element.get("href") for element in manifest.iter() if element.tag.endswith("}file")]
    every = {f"q{name}_{n}.xml": question for name, asked in quizzes.items() for n, question in enumerate(asked, 1)}
    assert listed == list(every)
    assert set(package.namelist()) == {"imsmanifest.xml", *every}
    for file, question in every.items():
        item = ET.fromstring(package.read(file))
        parts = [part.tag.removeprefix(QTI) for part in item]
        assert parts == PARTS + ["modalFeedback"] * len(question["answers"])
        (right,) = item.findall(f"{QTI}responseDeclaration/{QTI}correctResponse/{QTI}value")
        choices = item.findall(f".//{QTI}simpleChoice")
        said = item.findall(f"{QTI}modalFeedback")
        assert letters("".join(item.find(f".//{QTI}prompt").itertext())) == letters(str(question["question"]))
        for choice, because, answer in zip(choices, said, question["answers"], strict=True):
            assert choice.get("identifier") == because.get("identifier")
            assert (choice.get("identifier") == right.text) == bool(answer.get("right"))
            assert letters("".join(choice.itertext())) == letters(str(answer["answer"]))
            assert letters("".join(because.itertext())) == letters(str(answer["because"]))


def test_formulas_have_marks_that_platforms_know_and_no_macro_of_ours(files):
    text = files["gift/03_slicing.gift"]
    assert r"\\(\\mathrm&\#123;SW&\#125;_2^2\\)" in text
    assert "$" not in text.partition("\n")[2]
    assert not re.search(r"\\SW|\\CD|\\R(?![A-Za-z])", unescaped(text))
