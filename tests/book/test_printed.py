"""Slides, the printed book and the two editions, made from a small rendered page and a small notebook."""

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pikepdf
import pytest

from browser import watched_page
from editions import (
    YOUR_TURN,
    board_notes,
    build_wheel,
    instructor_edition,
    nbgrader_source,
    student_edition,
    without_outputs,
    write_zip,
)  # fmt: skip
from meshot_book.exercises.check import EXERCISES, key_of
from meshot_book.live import Answer, live_figure
from meshot_book.notebook import experiment_folder
from pdf import joined_link, lighten, write_document
from plain import CHAPTERS, plain_notebook, source_notebook
from rendered import read_article
from run_notebooks import retold_notebook
from slides import Slide, chapter_slides, stacks, write_all

PAGE = (
    """<!doctype html><html><body><article><section id="top"><h1>10 Trial<a class="headerlink" href="#top">#</a></h1>
<ul><li>add numbers</li></ul>
<section id="sums"><h2>10.1 Sums</h2><p>This section adds. See <a href="20_other.html#there">there</a>.</p>
<div class="math">\\[1 + 1\\]</div><p>More words on sums.</p>
<div class="cell"><details class="hide"><summary>Show code</summary><div class="cell_input"><pre>folded()</pre></div>
</details><div class="cell_output"><figure id="fig-a"><img src="_images/a.png" alt="a picture">
<figcaption>Figure 10.1</figcaption></figure></div></div>
<div class="cell"><div class="cell_input"><pre>print(2)</pre></div><div class="cell_output"><pre>2</pre></div></div>
<div class="cell"><div class="cell_input"><pre>"""
    + "x = 1\n" * 60
    + """</pre></div></div>
</section>
<section id="questions"><h2>10.2 Questions</h2><div class="quiz">ask</div></section>
<section id="ex"><h2>10.3 Exercises</h2><section><h3>Add two</h3><p>Try.</p></section></section>
</section></article></body></html>"""
)


@pytest.fixture
def html(tmp_path) -> Path:
    """A rendered book of two chapters."""
    tmp_path = tmp_path / "html"
    tmp_path.mkdir()
    (tmp_path / "10_trial.html").write_text(PAGE)
    (tmp_path / "20_other.html").write_text('<article><section id="there"><h1>20 Other</h1></section></article>')
    (tmp_path / "_images").mkdir()
    (tmp_path / "_images" / "a.png").write_bytes(
        (Path(__file__).parents[2] / "book/_static/circle_to_polygon.png").read_bytes()
    )
    (tmp_path / "_static" / "mathjax").mkdir(parents=True)
    for name in ("pygments.css", "mathjax/tex-chtml.js"):
        (tmp_path / "_static" / name).write_text("")
    return tmp_path


def test_each_slide_shows_one_thing(html):
    slides = chapter_slides(read_article(html / "10_trial.html"))
    shown = [slide.content for slide in slides]
    marks = ["10 Trial", "add numbers", "This section adds", "Figure 10.1", "print(2)", "x = 1", "Add two"]
    assert len(shown) == len(marks)
    assert all(mark in content for mark, content in zip(marks, shown, strict=True))
    assert "1 + 1" in slides[2].content
    assert slides[2].notes == "<p>More words on sums.</p>"
    assert slides[3].section == "10.1 Sums"
    assert not any(words in "".join(shown) for words in ("folded()", "headerlink", "ask"))


def test_twenty_slides_are_chosen_and_the_others_are_below_them(html):
    opening, figure, box, detail = (
        Slide("", content, "") for content in ("<h2>a", '<h3><img src="a">', '<div class="theorem proof">', "<pre>")
    )
    columns = stacks([opening, detail, *[opening, detail, box, figure, box] * 8, opening, detail, detail, opening])
    assert len(columns) == 20
    assert sum(map(len, columns)) == 46
    first = [column[0].kind for column in columns]
    assert first.count("figure") == 8  # one of every section
    assert first.count("box") == 8
    assert [column[0].kind for column in stacks(chapter_slides(read_article(html / "10_trial.html")))] == [
        "opening", "opening", "figure", "opening"
    ]  # fmt: skip


def test_slides_need_no_network_and_fit(html, context):
    write_all(html)
    with watched_page(context, html / "slides" / "10_trial.html") as (page, troubles):
        page.set_viewport_size({"width": 1280, "height": 720})
        page.wait_for_function("() => window.Reveal && Reveal.isReady()")
        assert page.evaluate("Reveal.getTotalSlides()") == 7
        places = page.evaluate(
            "Reveal.getSlides().map((slide) => Reveal.getIndices(slide)).map(({h, v}) => [h, v || 0])"
        )
        assert places == [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1], [2, 2], [3, 0]]
        for h, v in places:
            page.evaluate("([h, v]) => Reveal.slide(h, v)", [h, v])
            page.wait_for_timeout(100)
            ends = "Reveal.getCurrentSlide().querySelector('.content').getBoundingClientRect().bottom"
            assert page.evaluate(ends) <= 720, (h, v)
        assert page.locator("section a").first.get_attribute("href") == "../20_other.html#there"
        assert troubles == []


def _middle_on_screen(page, target):
    """Where a part of the frame is seen. The slide makes what does not fit smaller, which Playwright leaves out."""
    outer = page.evaluate("document.querySelector('iframe.live').getBoundingClientRect().toJSON()")
    inner, width = target.evaluate("(node) => [node.getBoundingClientRect().toJSON(), innerWidth]")
    scale = outer["width"] / width
    return [outer[side] + scale * (inner[side] + inner[size] / 2) for side, size in (("x", "width"), ("y", "height"))]


def test_interactive_figures_work_on_slides_and_turn_pages(html, context):
    page = html / "10_trial.html"
    figure, axes = plt.subplots()
    axes.plot([0, 1, 3], [0.5, 2, 2.5])
    points = {"source": [0.0, 1.0, 3.0], "target": [0.5, 2.0, 2.5], "exponent": 2}
    points |= {"source_masses": [1.0, 1.0, 1.0], "target_masses": [1.0, 1.0, 1.0]}
    answers = [Answer("more", "it moves farther", right=True), Answer("less", "it does not")]
    words = {"question": "What follows?", "answers": answers, "seen": "It rises.", "alt": "six points on two lines"}
    made = live_figure("sorting", points, still=figure, **words)
    output = f'<div class="cell"><div class="cell_output"><div class="output">{made.html}</div></div></div>'
    page.write_text(page.read_text().replace('<section id="questions">', output + '<section id="questions">'))
    write_all(html)
    with watched_page(context, html / "slides" / "10_trial.html") as (page, troubles):
        page.wait_for_function("() => window.Reveal && Reveal.isReady()")
        slide = page.locator("section section").filter(has=page.locator("iframe.live"))
        column = page.evaluate("Reveal.getIndices(document.querySelector('iframe.live').closest('section')).h")
        page.evaluate("(h) => Reveal.slide(h)", column)
        figure = slide.frame_locator("iframe.live")
        page.wait_for_function("() => document.querySelector('iframe.live').offsetHeight > 300")
        page.wait_for_timeout(300)  # until the slide has its size
        for target in (figure.get_by_label("more"), figure.get_by_text("Was I right?")):
            page.mouse.click(*_middle_on_screen(page, target))
            page.wait_for_timeout(300)  # the still gives way to the plots, and the slide has another size
        assert "it moves farther" in figure.locator(".verdict").inner_text()
        figure.get_by_label("more").press("PageDown")
        page.wait_for_function("(h) => Reveal.getIndices().h === h + 1", arg=column)
        assert troubles == []


def test_no_chapter_is_said(tmp_path):
    with pytest.raises(ValueError, match="holds no rendered chapter; render the book first"):
        write_all(tmp_path)


def test_the_book_is_one_document_with_links_within(html):
    document = write_document(html)
    text = document.read_text(encoding="utf-8")
    assert 'href="#20_other--there"' in text
    assert 'id="20_other--there"' in text
    assert 'id="10_trial--fig-a"' in text
    assert "folded()" not in text


def test_the_book_is_printed(html, root):
    subprocess.run([sys.executable, root / "book" / "pdf.py", "--html", html], check=True)
    assert (html.parent / "meshes_as_measures.pdf").read_bytes().startswith(b"%PDF")


def kept_in_a_lighter_pdf(path, drawn):
    """The picture that stays of one that a PDF stores with three bytes a pixel, and the share of bytes that stays."""
    with pikepdf.new() as pdf:
        pdf.add_blank_page(page_size=(300, 300))
        stored = pdf.make_stream(
            drawn.tobytes(), Type=pikepdf.Name.XObject, Subtype=pikepdf.Name.Image, Width=drawn.shape[1],
            Height=drawn.shape[0], ColorSpace=pikepdf.Name.DeviceRGB, BitsPerComponent=8,
        )  # fmt: skip
        pdf.pages[0].Resources = pikepdf.Dictionary(XObject=pikepdf.Dictionary(Im0=stored))
        pdf.save(path, compress_streams=True)
    before = path.stat().st_size
    lighten(path)
    with pikepdf.open(path) as pdf:
        kept = pikepdf.PdfImage(pdf.pages[0].get_images()["/Im0"]).as_pil_image().convert("RGB")
    return np.asarray(kept, dtype=int), path.stat().st_size / before


def test_a_picture_of_few_colours_keeps_every_pixel_in_a_lighter_pdf(tmp_path):
    few = np.random.default_rng(0).integers(0, 200, (90, 120))
    drawn = np.stack([few, 255 - few, few // 2], axis=2).astype(np.uint8)
    kept, share = kept_in_a_lighter_pdf(tmp_path / "a.pdf", drawn)
    assert np.array_equal(kept, drawn)
    assert share < 0.8


def test_a_picture_of_many_colours_stays_near_in_a_lighter_pdf(tmp_path):
    x, y = np.meshgrid(np.linspace(0, 1, 200), np.linspace(0, 1, 160))
    drawn = (255 * np.stack([x, y, 0.5 + 0.5 * np.sin(9 * x * y)], axis=2)).round().astype(np.uint8)
    kept, share = kept_in_a_lighter_pdf(tmp_path / "a.pdf", drawn)
    assert np.abs(kept - drawn).mean() < 3  # of 255
    assert share < 0.5


@pytest.mark.parametrize(
    ("link", "leads"),
    [
        ("#a", "#10_trial--a"),
        ("20_other.html", "#20_other"),
        ("20_other.html#b", "#20_other--b"),
        ("api/index.html#c", "api/index.html#c"),
        ("_images/a.png", "_images/a.png"),
    ],
)
def test_links_lead_within_the_document(link, leads):
    assert joined_link(link, "10_trial", {"10_trial", "20_other"}) == leads


GUIDE = "# Guide\n\n## On the board\n\n- **10**: draw a triangle\n  and a line.\n- **11**: write.\n\n## Next\n"


def test_editions_differ_in_solutions_and_board_notes():
    assert board_notes(GUIDE) == {"10": "draw a triangle and a line.", "11": "write."}
    words, code = nbformat.v4.new_markdown_cell, nbformat.v4.new_code_cell
    output = nbformat.v4.new_output("stream", text="✓ right")
    source = nbformat.v4.new_notebook(
        cells=[
            words("# Trial\n\nThe solution of an equation. Solutions are folded."),
            code("def f():\n    raise NotImplementedError", metadata={"tags": ["exercise"]}),
            code("check.f(f)", outputs=[output]),
            words(":::{dropdown} Hint\nthink\n:::"),
            code("def f(): return 1", metadata={"tags": ["solution"]}, outputs=[output]),
            words("The solution above is short.\n\nNext."),
            code("one = f()"),
            code("assert one == 1", metadata={"tags": ["checks"]}),
            code("one = 1"),
            code("assert one == 1", metadata={"tags": ["checks"]}),
            words("**More to try**\n\n:::{dropdown} Answers\n- secret\n:::\nafter"),
        ]
    )
    student = student_edition(source)
    nbformat.validate(student)
    assert [(cell.source, cell.metadata.get("tags", [])) for cell in student.cells] == [
        ("# Trial\n\nThe solution of an equation. The solutions are in the instructor edition.", []),
        ("def f():\n    raise NotImplementedError", ["exercise"]),
        ("check.f(f)", []),
        (":::{dropdown} Hint\nthink\n:::", []),
        (YOUR_TURN, []),
        ("\nNext.", []),
        ("one = f()", ["raises-exception"]),
        ("one = 1", []),
        ("assert one == 1", ["checks"]),
        ("**More to try**\n\n*The answers are in the instructor edition.*\nafter", []),
    ]
    assert [cell.get("outputs", []) for cell in without_outputs(student).cells[1:3]] == [[], []]
    assert source.cells[2].outputs == [output]
    instructor = instructor_edition(source, "draw a triangle and a line.")
    assert instructor.cells[1].source == "**On the board.** draw a triangle and a line."
    assert [cell.source for cell in source.cells] == [
        cell.source for cell in instructor.cells if cell.id != "on-the-board"
    ]
    nbformat.validate(instructor)


def test_an_assignment_holds_each_solution_where_nbgrader_cuts_it_out():
    words, code = nbformat.v4.new_markdown_cell, nbformat.v4.new_code_cell
    stub = 'def diagnosis(*k):\n    """Words."""\n    raise NotImplementedError'
    solution = (
        "import math\n\ndef diagnosis(*k):\n    if k:\n        return 1\n\ncheck.diagnosis(diagnosis)\nassert math.pi"
    )
    source = nbformat.v4.new_notebook(
        cells=[
            words("# Trial"),
            code(stub, metadata={"tags": ["exercise"]}),
            code("from meshot_book.exercises import check\n\ncheck.diagnosis(diagnosis)"),
            code(solution, metadata={"tags": ["solution"]}),
            words("Next."),
        ]
    )
    made = nbgrader_source(source)
    nbformat.validate(made)
    answer, graded = made.cells[1:3]
    assert answer.source == (
        'def diagnosis(*k):\n    """Words."""\n    ### BEGIN SOLUTION\n    import math\n    if k:\n        return 1\n'
        "    ### END SOLUTION"
    )
    usual = {"schema_version": 3, "task": False}
    assert answer.metadata.nbgrader == usual | {
        "grade_id": "diagnosis", "grade": False, "solution": True, "locked": False
    }  # fmt: skip
    assert graded.source.endswith("check.diagnosis(diagnosis).points")
    assert graded.metadata.nbgrader == usual | {
        "grade_id": "check_diagnosis", "grade": True, "solution": False, "locked": True, "points": 1
    }  # fmt: skip
    assert [cell.source for cell in made.cells[3:]] == ["Next."]


def test_every_exercise_is_graded_in_an_assignment():
    graded = []
    for path in sorted(CHAPTERS.glob("[0-9]*.md")):
        described = [
            cell.metadata.nbgrader
            for cell in nbgrader_source(source_notebook(path)).cells
            if "nbgrader" in cell.metadata
        ]
        names = [each.grade_id for each in described]
        assert names[1::2] == [f"check_{name}" for name in names[::2]]
        graded += names[::2]
    assert sorted(graded) == sorted(EXERCISES)


def test_students_read_of_nothing_that_they_do_not_have():
    chapters = [student_edition(source_notebook(path)) for path in sorted(CHAPTERS.glob("[0-9]*.md"))]
    texts = ["\n".join(cell.source for cell in chapter.cells if cell.cell_type == "markdown") for chapter in chapters]
    assert len(texts) > 20
    for text in texts:
        assert re.findall(r"folded away|olutions are folded|answer is explained|\{dropdown\} Answer", text) == []
        assert re.findall(r"\bthe solution\b(?! is in)", text.partition("Exercises\n")[2], re.I) == []
        assert text.count("in the instructor edition") >= 4


def test_a_zip_holds_what_its_notebooks_need(tmp_path, monkeypatch):
    wheel = tmp_path / "meshot-1-py3-none-any.whl"
    wheel.write_bytes(b"wheel")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# Trial", id="a")])
    write_zip(tmp_path / "student.zip", "student", {"10_trial": notebook}, wheel)
    with zipfile.ZipFile(tmp_path / "student.zip") as archive:
        archive.extractall(tmp_path)
    folder = tmp_path / "student"
    assert {path.name for path in folder.iterdir()} == {
        "START_HERE.md", "LICENSE", "constraints.txt", "experiments", "meshot-1-py3-none-any.whl", "notebooks",
        "requirements.txt",
    }  # fmt: skip
    assert nbformat.read(folder / "notebooks" / "10_trial.ipynb", as_version=4) == notebook
    assert "./meshot-1-py3-none-any.whl[bids,cortex]" in (folder / "requirements.txt").read_text(encoding="utf-8")
    start = (folder / "START_HERE.md").read_text(encoding="utf-8")
    assert "raise NotImplementedError" in start
    assert "No address was named" in start
    # The notebooks find the results there, without a checkout and without a network.
    monkeypatch.chdir(folder / "notebooks")
    assert experiment_folder("ddot") == folder / "experiments" / "ddot"
    assert (folder / "experiments" / "ddot" / "held_out.safetensors").is_file()


def test_students_get_no_solution():
    """The longest line of every solution is in no cell of their notebook."""
    for path in sorted(CHAPTERS.glob("[0-9]*.md")):
        whole = source_notebook(path)
        solutions = [cell.source for cell in whole.cells if "solution" in cell.metadata.get("tags", [])]
        text = nbformat.writes(without_outputs(plain_notebook(student_edition(whole), path.stem, answers=False)))
        assert len(solutions) >= 2
        for lines in map(str.splitlines, solutions):
            line = max((line.strip() for line in lines if line.startswith("    ")), key=len)
            # Chapter 20 derives this one, and computes a table by it.
            assert json.dumps(line)[1:-1] not in text or line == "return max(value**2 - floor**2, 0.0) ** 0.5"


@pytest.fixture(scope="module")
def student_package(tmp_path_factory) -> Path:
    """What the wheel of the students holds."""
    folder = tmp_path_factory.mktemp("wheel")
    with zipfile.ZipFile(build_wheel(folder, solutions=False)) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_wheel_of_the_students_judges_as_the_full_one_without_its_solutions(student_package):
    inside = {
        path.relative_to(student_package / "meshot_book").as_posix()
        for path in (*student_package.glob("meshot_book/**/*.py*"), *student_package.glob("meshot_book/**/*.json"))
    }
    ours = {Path(sys.modules[found.__module__].__file__).name for found in EXERCISES.values()}
    assert ours == {"cortex.py", "flows.py", "measures.py", "points.py", "trials.py"}
    assert {file for file in inside if file.startswith("exercises/")} == {
        "exercises/__init__.py", "exercises/__init__.pyi", "exercises/given.py", "exercises/reports.py",
        "exercises/verdict.py", "exercises/check/__init__.py", "exercises/check/answers.json",
    }  # fmt: skip
    file = student_package / "meshot_book/exercises/check/answers.json"
    answers = json.loads(file.read_text(encoding="utf-8"))
    assert {name: (each["words"], each["stars"]) for name, each in answers.items()} == {
        name: (found.__doc__, found.stars) for name, found in EXERCISES.items()
    }
    for name, each in answers.items():
        found = EXERCISES[name].exercise()
        assert key_of(each["key"]).judged(found.truth) == (len(found.cases), None), name
        for hint, functions in found.mistakes.items():
            for mistake in functions if isinstance(functions, tuple) else (functions,):
                assert key_of(each["key"]).judged(mistake)[1] == hint, name


def test_the_wheel_of_the_students_checks_and_marks_by_itself(student_package, tmp_path):
    answer = "def diagnosis(*k):\n    return next((i for i, q in enumerate(k) if q >= 1), 3)"
    codes = ("from meshot_book.exercises import check", answer, "check.diagnosis(diagnosis)")
    cells = [nbformat.v4.new_code_cell(code) for code in codes]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "kim.ipynb")
    environment = os.environ | {"PYTHONPATH": str(student_package)}
    run = [sys.executable, "-m", "meshot_book.marks", str(tmp_path)]
    done = subprocess.run(run, cwd=tmp_path, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert "kim           1   1" in done.stdout, done


@pytest.mark.thorough
def test_an_unpacked_edition_runs_without_the_checkout(tmp_path):
    """Chapter 10 of the students, with the package from the wheel of the zip."""
    wheel, name = build_wheel(tmp_path, solutions=False), "10_beyond_the_theorem"
    told = retold_notebook(CHAPTERS / f"{name}.md")
    student = without_outputs(plain_notebook(student_edition(told), name, answers=False))
    write_zip(tmp_path / "student.zip", "student", {name: student}, wheel)
    for file in (tmp_path / "student.zip", wheel):
        with zipfile.ZipFile(file) as archive:
            archive.extractall(tmp_path / "site" if file == wheel else tmp_path)
    folder, site = tmp_path / "student" / "notebooks", tmp_path / "site"
    place = "import meshot_book, sys; assert meshot_book.__file__.startswith(sys.argv[1])"
    environment = os.environ | {"PYTHONPATH": str(site)}
    environment.pop("MESHOT_REPOSITORY", None)
    subprocess.run([sys.executable, "-c", place, str(site)], cwd=folder, env=environment, check=True)
    run = [sys.executable, "-m", "jupyter", "nbconvert", "--to", "notebook", "--execute", f"{name}.ipynb"]
    done = subprocess.run(run, cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
