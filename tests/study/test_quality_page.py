"""The quality page: marks, verdicts by key, tables of verdicts, hostile names, and a browser without a network."""

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from PIL import Image

from browser import barriers, offline_browser, watched_page
from meshot.cli import main
from meshot.study import read_subjects, write_quality_page, write_subjects
from meshot.study.quality import quality_columns, row_key
from preflight import browser as browser_path

HOSTILE = "sub-<img src=x onerror=alert(1)>"
N_SUBJECTS = 12


def subject(i: int, **more) -> dict:
    row = {
        "participant_id": f"sub-{i:02d}",
        "status": "done",
        "report": f"sub-{i:02d}/report.html",
        "seconds": 60.0 + i,
    }
    for side in ("left", "right"):
        row |= {f"{side}_white_euler": 2, f"{side}_white_area_mm2": 85_000.0 + 100 * i}
        row |= {f"{side}_white_self_intersecting_faces": 0, f"{side}_white_distance_from_initial_mm": 0.3}
    return row | {"warnings": 0} | more


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("a <study> & more")
    rows = [subject(i) for i in range(1, N_SUBJECTS + 1)]
    rows[3]["left_white_area_mm2"] = 190_000.0
    rows[5] |= {"left_white_euler": -4, "warnings": 2, "warning_names": "volume <contrast>"}
    rows[7] = {"participant_id": HOSTILE, "session_id": "ses-a", "status": "failed", "error": "it <b>broke</b>"}
    rows[8]["report"] = "javascript:alert(1)"
    rows[9]["report"] = "../outside.html"
    write_subjects(folder, rows)
    (folder.parent / "outside.html").write_text("outside")
    for row in rows[:7]:
        place = folder / row["participant_id"]
        place.mkdir()
        (place / "report.html").write_text("<title>report</title>")
        grey = np.full((480, 720, 3), 90, np.uint8)
        Image.fromarray(grey).save(place / "slices.webp")
    assert main(["quality", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def context():
    with offline_browser(browser_path()) as found:
        yield found


@pytest.fixture
def opened(study, context):
    with watched_page(context, study / "quality.html") as (page, troubles):
        page.evaluate("() => localStorage.clear()")
        page.reload()
        yield page
        assert troubles == []


def order(page) -> list[str]:
    page.wait_for_timeout(150)
    cards = [name.strip() for name in page.locator(".card:not([hidden]) h3 > span").all_text_contents()]
    rows = [name.strip() for name in page.locator("tbody tr:not([hidden]) th").all_text_contents()]
    assert cards == rows
    return cards


def verdict_of(page, name: str) -> str:
    return page.locator(".card", has=page.get_by_text(name, exact=True)).get_attribute("data-verdict")


def test_the_most_unusual_is_first_and_marked_with_its_reason(opened):
    assert order(opened)[:2] == ["sub-06", "sub-04"]
    reasons = opened.locator(".card").nth(0).inner_text()
    assert "left euler −4, robust z −∞" in reasons
    assert "warnings: volume <contrast>" in reasons
    assert "left area (mm²) 190 000" in opened.locator(".card").nth(1).inner_text().replace("\u202f", " ")
    assert opened.locator("td.odd").count() == 3
    assert "12 rows: 1 failed, 1 with warnings" in opened.locator("header").inner_text()


def test_names_and_messages_are_text_and_links_stay_in_the_study(opened):
    assert opened.locator("main img[src=x], main li b").count() == 0
    # Not the inner texts: what is out of view may not be drawn yet.
    assert "it <b>broke</b>" in [text.strip() for text in opened.locator(".empty").all_text_contents()]
    assert f"{HOSTILE} ses-a" in order(opened)
    links = opened.eval_on_selector_all(".card a", "links => links.map((link) => link.getAttribute('href'))")
    assert sorted(links) == [f"sub-{i:02d}/report.html" for i in range(1, 8)]


def test_headings_sort_both_ways_with_missing_values_last(opened):
    head = opened.get_by_role("button", name="right area (mm²)")
    head.click()
    up = order(opened)
    assert up == [f"sub-{i:02d}" for i in range(1, 13) if i != 8] + [f"{HOSTILE} ses-a"]
    assert opened.locator("th[aria-sort=ascending]").inner_text().startswith("right area")
    head.click()
    assert order(opened) == up[-2::-1] + up[-1:]


def test_keys_judge_and_move_and_verdicts_outlive_a_reload(opened):
    opened.locator(".card").first.focus()
    for key in "adrju":
        opened.keyboard.press(key)
    names = order(opened)
    assert [verdict_of(opened, name) for name in names[:5]] == ["accept", "doubt", "reject", "", ""]
    opened.keyboard.press("k")
    assert opened.evaluate("() => document.activeElement.querySelector('h3 span').textContent") == names[3]
    opened.reload()
    assert verdict_of(opened, names[2]) == "reject"
    opened.locator("#show").select_option("doubt")
    assert order(opened) == [names[1]]
    assert "1 of 12 shown; 1 accept, 1 doubt, 1 reject" in opened.locator("#count").inner_text()
    opened.locator("#find").fill("nobody")
    assert opened.locator("#nothing").is_visible()


def test_buttons_judge_and_a_key_with_control_does_not(opened):
    card = opened.locator(".card").first
    card.get_by_role("button", name="reject").click()
    assert card.get_by_role("button", name="reject").get_attribute("aria-pressed") == "true"
    card.focus()
    opened.keyboard.press("Control+d")
    assert card.get_attribute("data-verdict") == "reject"
    card.get_by_role("button", name="reject").click()
    assert card.get_attribute("data-verdict") == ""


def test_the_larger_picture_and_the_report_open(opened):
    opened.locator(".card").first.focus()
    opened.keyboard.press("z")
    opened.locator("dialog img").wait_for()
    opened.keyboard.press("Escape")
    assert not opened.locator("dialog").is_visible()
    # The link is caught: a page that is left cancels the pictures that it still loads.
    opened.evaluate("""() => addEventListener("click", (event) => {
      window.led = event.target.href;
      event.preventDefault();
    })""")
    opened.keyboard.press("o")
    assert opened.evaluate("() => window.led").endswith("/sub-06/report.html")


def test_verdicts_are_downloaded_and_loaded(opened, tmp_path):
    opened.locator(".card").first.focus()
    opened.keyboard.press("r")
    opened.keyboard.press("a")
    with opened.expect_download() as download:
        opened.locator("#download").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    lines = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()]
    assert lines[0] == ["participant_id", "session_id", "verdict"]
    assert {line[0]: line[2] for line in lines[1:]} == {
        row["participant_id"]: {"sub-06": "reject", "sub-04": "accept"}.get(row["participant_id"], "n/a")
        for row in read_subjects(path_of(opened))
    }
    opened.evaluate("() => localStorage.clear()")
    opened.reload()
    assert verdict_of(opened, "sub-06") == ""
    opened.locator("#load").set_input_files(path)
    opened.wait_for_function("() => document.querySelectorAll('[data-verdict=reject]').length === 1")
    assert verdict_of(opened, "sub-04") == "accept"


def path_of(page):
    return Path(unquote(urlsplit(page.url).path)).parent


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n", "has no columns participant_id, session_id, verdict"),
        ("participant_id\tsession_id\tverdict\nsub-01\tn/a\tperhaps\n", "line 2 has the verdict perhaps"),
        ("participant_id\tsession_id\tverdict\nsub-99\tn/a\taccept\n", "holds no verdict on a subject of this study"),
    ],
)
def test_a_wrong_table_of_verdicts_is_refused_as_a_whole(opened, tmp_path, text, said):
    (tmp_path / "wrong.tsv").write_text(text)
    opened.locator("#load").set_input_files(tmp_path / "wrong.tsv")
    opened.wait_for_selector("#trouble:not([hidden])")
    assert said in opened.locator("#trouble").inner_text()
    assert opened.locator("[data-verdict]:not([data-verdict=''])").count() == 0


def test_the_page_is_open_to_all_and_fits(opened):
    for width in (1280, 400):
        opened.set_viewport_size({"width": width, "height": 900})
        assert opened.evaluate("() => document.documentElement.scrollWidth") <= width
    assert barriers(opened) == []
    opened.emulate_media(color_scheme="dark")
    assert barriers(opened) == []


def test_an_embedded_page_needs_no_pictures_beside_it(study, tmp_path):
    before = (study / "quality.html").read_text(encoding="utf-8")
    page = write_quality_page(study, embed=True).read_text(encoding="utf-8")
    assert page.count("data:image/webp;base64,") == 7
    write_quality_page(study)
    assert (study / "quality.html").read_text(encoding="utf-8") == before
    assert not re.search(r"(?:src|href)=\"https?:", before)


def test_few_subjects_have_no_scores(tmp_path):
    write_subjects(tmp_path, [subject(i, left_white_euler=-10 * (i == 2)) for i in range(1, 5)])
    said = "5 rows with surfaces are needed, and there are 4."
    assert said in write_quality_page(tmp_path).read_text(encoding="utf-8")
    failed = {"participant_id": "sub-05", "status": "failed", "error": "no scan"}
    write_subjects(tmp_path, [*read_subjects(tmp_path), failed])
    assert said in write_quality_page(tmp_path).read_text(encoding="utf-8")
    assert not any(column.is_odd(row) for column in quality_columns(read_subjects(tmp_path)) for row in range(4))


def test_a_verdict_belongs_to_the_numbers_that_were_seen():
    assert row_key(subject(1)) == row_key(subject(1, seconds=3.0))
    assert len({row_key(subject(1)), row_key(subject(2)), row_key(subject(1, left_white_area_mm2=1.0))}) == 3


@pytest.mark.parametrize(("rows", "said"), [(None, "does not exist"), ([], "has no rows")])
def test_a_folder_that_is_no_study_is_refused(tmp_path, capsys, rows, said):
    if rows is not None:
        write_subjects(tmp_path, rows)
    assert main(["quality", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "quality.html").exists()
