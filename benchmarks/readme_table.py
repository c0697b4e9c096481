"""Write the table of the benchmark into README.md, between its markers: ``python benchmarks/readme_table.py``."""

from pathlib import Path

from meshot.files import whole_file
from meshot.report.numbers import digits
from meshot.report.results import read_results

ROOT = Path(__file__).resolve().parent.parent
README, RESULTS = ROOT / "README.md", ROOT / "experiments" / "cost" / "results.json"
BEGIN, END = "<!-- benchmark -->", "<!-- /benchmark -->"


def benchmark_block(record: dict) -> str:
    """The targets and what was found, and where the numbers come from."""
    lines = [
        BEGIN,
        f"Value and gradient, weighted, {record['config']['n_directions']} directions, float64, medians; written by "
        f"`{record['command']}` on {record['date']} ({record['machine']}). All peers and sizes: chapter 12.",
        "",
        "| the fused sliced loss | found | target | |",
        "|---|---|---|---|",
    ]
    for row in record["results"]["targets"]:
        found = "not measured" if row["found"] is None else f"{digits(row['found'], 3)} {row['unit']}".strip()
        target = f"{'≥' if row['at_least'] else '≤'} {digits(row['limit'])} {row['unit']}".strip()
        verdict = {True: "met", False: "missed", None: "–"}[row["met"]]
        lines.append(f"| {row['what']} | {found} | {target} | {verdict} |")
    return "\n".join([*lines, END])


def with_block(text: str, block: str) -> str:
    """The text with what stands between the markers replaced.

    Raises
    ------
    ValueError
        If a marker is missing.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"README.md has no {BEGIN} ... {END}; put both lines where the table shall stand")
    return text[: text.index(BEGIN)] + block + text[text.index(END) + len(END) :]


if __name__ == "__main__":
    made = with_block(README.read_text(encoding="utf-8"), benchmark_block(read_results(RESULTS)))
    with whole_file(README) as temporary:
        temporary.write_text(made, encoding="utf-8")
    print("wrote README.md")
