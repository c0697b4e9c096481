"""What a test can hold of the rules for prose, on every page: words that say nothing, and long sentences."""

import re
from collections.abc import Iterator

import pytest

from plain import source_notebook

PAGES = ("index", "getting_started", "howto", "freesurfer", "teaching", "limits", "notation")
LONGEST_SENTENCE = 40

#: Words and phrases, and why they do not stand in the book. Case does not matter.
BANNED = {
    r"hardly|scarcely|dozens|myriads?|plethora|a handful of|a host of": "give the number",
    r"obviously|of course|needless to say|trivially|it is clear that|it is easy to see": "say the reason or nothing",
    r"really|extremely|incredibly": "give the number, or leave it out",
    r"(?<!power )laws? of (?:a|the) (?:mesh|surface|points?|sample)|uniform laws?": "say distribution",
    r"pull(?:s|ed)? of (?:a|the) loss": "say gradient or descent direction",
    r"(?:loss|losses|metrics?|numbers|measures?|networks?|optimisers?|Chamfer|Wasserstein|transport) "
    r"(?:sees?|wants?|says?|asks?|tells?|feels?|likes?|thinks?|believes?|hopes?|dreams?|cares?)": "losses do not speak",
    r"behind the scenes|under the hood|at the end of the day|in a nutshell|the devil is in": "say it plainly",
    r"let us|let's": "say what is done",
    r"(?:training|validation|held-out|test|procedural|synthetic) heads?": "say subject: a head lies in a scanner",
    r"crossing faces?|faces? cross(?:es|ed)?(?! (?:the|a|an|this|its|zero)\b)": "say that faces intersect",
    r"places? of (?:the )?(?:points?|vertices|supports?)": "say position",
}
_BANNED = [(re.compile(rf"\b(?:{words})\b", re.I), remedy) for words, remedy in BANNED.items()]
_FENCED = re.compile(r"^(`{3,}).*?^\1[ \t]*$", re.M | re.S)
_HEADING = re.compile(r"^(#{1,4}) +(.*)$", re.M)
_DROPPED = (
    re.compile(r"^:{3,}.*$|^:[\w-]+:.*$|^\([\w-]+\)=$|^\|.*$", re.M),  # fences, options, labels, tables
    re.compile(r"<[^>]+>|\]\{\.[^}]*\}"),
    re.compile(r"\{[a-z:]+\}`[^`]*`"),
)
_BLOCK = re.compile(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.|:) )")
_STOP = re.compile(r"(?<=[.!?:])[\"”’)*]*\s+(?=[A-Z\[$*`“(])")
_SHORT = re.compile(r"\b(?:e\.g|i\.e|cf|vs|Fig|Eq|Thm|Sec|App|al|approx)\.")


def sentences(text: str) -> Iterator[str]:
    """The sentences of Markdown, each as one line; a formula is one word, a list item a sentence of its own."""
    text = _FENCED.sub("\n\n", text)
    text = re.sub(r"\$\$.*?\$\$", " formula ", text, flags=re.S)
    text = re.sub(r"\$[^$]+\$", "Formula", text)
    text = _HEADING.sub("\n\n", text)
    for pattern in _DROPPED:
        text = pattern.sub(" ", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`", "code", text)
    for block in _BLOCK.split(text):
        line = _SHORT.sub(lambda word: word[0].replace(".", ""), " ".join(block.split()))
        yield from (part for part in _STOP.split(line) if part)


def lapses(text: str) -> list[str]:
    """What is against the rules in one piece of Markdown."""
    found = []
    for sentence in sentences(text):
        n_words = len(re.findall(r"\w[\w'’.,-]*", sentence))
        if n_words > LONGEST_SENTENCE:
            found.append(f"{n_words} words: {sentence[:80]}…")
        for pattern, remedy in _BANNED:
            word = pattern.search(sentence)
            if word:
                found.append(f"{word[0]!r} ({remedy}): {sentence[:80]}")
    return found


def pytest_generate_tests(metafunc):
    if "chapter" in metafunc.fixturenames:
        paths = sorted((metafunc.config.rootpath / "notebooks").glob("[0-9][0-9]_*.md"))
        metafunc.parametrize("chapter", paths, ids=lambda path: path.stem)


def test_a_chapter_keeps_the_rules(chapter):
    cells = source_notebook(chapter).cells
    assert lapses("\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")) == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_keeps_the_rules(root, name):
    assert lapses((root / "book" / f"{name}.md").read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("word " * 41 + ".", "41 words"),
        ("A loss sees points.", "losses do not speak"),
        ("There are dozens.", "give the number"),
        ("Of course it holds.", "say the reason"),
        ("We use training heads.", "say subject"),
        ("There are two crossing faces.", "faces intersect"),
        ("No face crosses another.", "faces intersect"),
        ("The places of points move.", "say position"),
    ],
)
def test_each_lapse_is_seen(text, seen):
    assert any(seen in found for found in lapses(text))


def test_good_prose_has_no_lapse():
    text = "## Head\n\nThe loss of $x$ is small, e.g. 3 mm. [Table](#tab-a) shows it:\n\n- one\n- two\n\n| a |\n|---|\n"
    assert lapses(text) == []
    assert list(sentences(text)) == ["The loss of Formula is small, eg 3 mm.", "Table shows it:", "- one", "- two"]
