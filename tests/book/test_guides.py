"""The pages that show how to use the package: their programs run, their commands parse, and they cover the parser."""

import argparse
import re
import shlex

import nbformat
import numpy as np
import pytest

import meshot
from commands_extension import command_page
from meshot.cli import make_parser
from meshot.mesh import icosphere
from meshot.provenance import read_results
from scripts import scripts_in
from shown_extension import shown_html

PAGES = ("README.md", "book/getting_started.md", "book/howto.md", "book/freesurfer.md")


def blocks(page: str, language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", page, re.M | re.S)
    assert found
    return found


@pytest.mark.parametrize("name", PAGES)
def test_the_programs_run(root, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    meshot.write_mesh("predicted.ply", icosphere(2, 38.0))
    meshot.write_mesh("lh.white.surf.gii", icosphere(2, 40.0))
    shown: dict[str, object] = {}
    for program in blocks((root / name).read_text(encoding="utf-8"), "python"):
        exec(compile(program, name, "exec"), shown)
    if "fitted" in shown:
        assert shown["fitted"].losses[-1] < 0.5
        assert (shown["back"] - shown["predicted"].vertices).abs().max() < 0.5  # of 2 mm
        assert shown["loss"] < 0.5 * meshot.sliced_wasserstein(shown["predicted"], shown["target"])


def commands(text: str) -> list[list[str]]:
    lines = (line for block in blocks(text, "sh") for line in block.splitlines())
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("meshot ")]


@pytest.mark.parametrize("name", PAGES)
def test_the_commands_parse(root, name):
    found = commands((root / name).read_text(encoding="utf-8"))
    assert found
    for words in found:
        make_parser().parse_args(words)


def test_the_page_of_the_command_line_says_what_the_parser_says():
    page = command_page(make_parser())
    for words in ("## `meshot evaluate`", "`--emd-blur MM`", "(default: 100000)", "Not for clinical use", "warmup"):
        assert words in page
    assert "%(default)s" not in page


def test_a_new_command_is_on_the_page():
    parser = argparse.ArgumentParser(prog="tool")
    command = parser.add_subparsers(metavar="COMMAND").add_parser(
        "go", help="go there", description="Fast.", epilog="See --far.\n\n  tool go"
    )
    command.add_argument("--number", type=int, default=3, help="how often (default: %(default)s)")
    page = command_page(parser)
    assert "## `tool go`\n\nGo there. Fast." in page
    assert "`--number NUMBER`\n: How often (default: 3)." in page
    assert page.endswith("See `--far`.\n\n```sh\ntool go\n```\n")


def test_what_a_cell_shows_is_found_or_missed_by_name(tmp_path):
    output = nbformat.v4.new_output("execute_result", {"text/plain": "Player(3)", "text/html": "<p>x</p>"})
    file = tmp_path / "01_a.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("p", outputs=[output])]), file)
    assert shown_html(file, "Player") == "<p>x</p>"
    with pytest.raises(ValueError, match="no output of 01_a\\.ipynb begins with 'Scene'"):
        shown_html(file, "Scene")


@pytest.fixture
def numbers(root):
    """The script that writes the table of the README."""
    with scripts_in(root / "tools") as load:
        yield load("readme_numbers")


def test_the_table_of_the_readme_is_that_of_the_results(root, numbers):
    text = (root / "README.md").read_text(encoding="utf-8")
    assert numbers.with_numbers(text, root) == text
    assert text.count("| P1: ") == text.count("| S1") == 4
    with pytest.raises(ValueError, match="once each"):
        numbers.with_numbers(text.replace(numbers.END, ""), root)


def test_the_accuracy_of_carried_vertices_is_that_of_the_experiment(root):
    means = read_results(root / "experiments" / "correspondence" / "results.json")["results"]["means"]
    text = " ".join((root / "book" / "howto.md").read_text(encoding="utf-8").split())
    carried, registered, best = (means["vertices_mm"][k]["mean"] for k in ("carried", "registered", "best affine"))
    assert f"On {means['hemispheres']} held-out synthetic hemispheres, a carried vertex lies {carried:.1f} mm" in text
    assert f"The registration alone leaves {registered:.1f} mm" in text
    assert f"fits the true positions best leaves {best:.1f} mm" in text
    assert f"The two surfaces lie {means['surface_mm']:.2f} mm apart" in text
    regions = means["regions"]
    assert f"{regions['right_percent']:.1f} % of the vertices get their true region" in text
    areas, depths = (regions[f"{key}_error"] for key in ("area_percent", "thickness_mm"))
    middle = [np.median(list(each.values())) for each in (areas, depths)]
    assert f"The area of a region is wrong by {middle[0]:.1f} % and its thickness by {middle[1]:.2f} mm" in text
    assert [max(each, key=each.get) for each in (areas, depths)] == ["entorhinal", "parahippocampal"]
    assert f"for the area, with {max(areas.values()):.0f} %, and the parahippocampal gyrus" in text
    assert f"for the thickness, with {max(depths.values()):.2f} mm" in text


def test_the_limits_state_what_was_measured_of_a_person(root):
    """The page, and the box of chapter 23, which its checks compare with the results, too."""
    text = (root / "book" / "limits.md").read_text(encoding="utf-8")
    before = read_results(root / "experiments" / "beside_freesurfer" / "before.json")["results"]
    rows = {row["side"]: row for row in before["rows"] if row["stage"] == "final"}
    left, right = rows["left"], rows["right"]
    assert f"{left['assd_mm']:.2f} and {right['assd_mm']:.2f} mm from FreeSurfer's (left and right)" in text
    assert {f"about {-row['signed_mm']:.1f} mm too far inside" in text for row in (left, right)} == {True}
    assert f"a volume that is {-left['volume_percent']:.0f} % and {-right['volume_percent']:.0f} % smaller" in text
    lost = read_results(root / "experiments" / "shown_person" / "results.json")["results"]["sides"]
    assert [f"{lost[side]['given_up']['cm3']:.1f}" for side in rows] == ["6.7", "6.6"]
    assert "6.7 and 6.6 cm³ of white matter (left and right) are given up" in text
    assert f"moves vertices by up to {max(row['largest_repair_mm'] for row in (left, right)):.1f} mm" in text
    shares = read_results(root / "experiments" / "warnings" / "second" / "results.json")["results"]["shares"]
    good, spoiled = (shares[f"judgement, {kind}, all"]["new"] for kind in ("good", "spoiled"))
    assert (
        f"A warning is given for {good['warned']} of {good['of']} good synthetic subjects and for both adults" in text
    )
    assert spoiled["warned"] == spoiled["of"]
    assert f"All {spoiled['of']} heads that were spoiled on purpose have one" in text
