"""Write the results of the benchmarks into book/speed.md, between its markers: ``python benchmarks/speed_page.py``."""

from pathlib import Path

from meshot.files import write_whole
from meshot.provenance import read_results
from meshot_book.notebook import digits

ROOT = Path(__file__).resolve().parent.parent
PAGE, COST = ROOT / "book" / "speed.md", ROOT / "experiments" / "cost"
MARKERS = "<!-- {} -->", "<!-- /{} -->"


def losses_block(record: dict) -> str:
    """Targets and results of the losses, with their provenance."""
    lines = [
        f"Value and gradient, weighted, {record['config']['n_directions']} directions, float64, medians; written by "
        f"`{record['command']}` on {record['date']} ({record['machine']}). All peers and sizes: chapter 9.",
        "",
        "| the fused sliced loss | found | target | |",
        "|---|---|---|---|",
    ]
    for row in record["results"]["targets"]:
        found = "not measured" if row["found"] is None else f"{digits(row['found'], 3)} {row['unit']}".strip()
        target = f"{'≥' if row['at_least'] else '≤'} {digits(row['limit'])} {row['unit']}".strip()
        verdict = {True: "met", False: "missed", None: "–"}[row["met"]]
        lines.append(f"| {row['what']} | {found} | {target} | {verdict} |")
    return "\n".join(lines)


def ruler_block(record: dict) -> str:
    """The parts of an evaluation with their times."""
    config = record["config"]
    what = f"`meshot.evaluate` on two surfaces of {config['faces']} faces, {config['points']} points on each"
    return parts_block(what, record)


def reconstruction_block(record: dict) -> str:
    """The stages of a reconstruction with their times."""
    config = record["config"]
    what = "`meshot reconstruct` on the MNI152 average"
    what += ", without the flow" if config["initial_only"] else ""
    what += f"; the flow alone carries {config['flow_vertices']} vertices in {config['flow_steps']} steps"
    return parts_block(what, record)


def windows_block(record: dict) -> str:
    """The time of the windowed loss beside that of a plain computation, and of the sliced loss."""
    config = record["config"]
    what = f"{config['windows']} windows with {config['directions']} directions each and their gradient, between two "
    what += f"cortical surfaces of {config['faces'][0]} and {config['faces'][1]} faces, as varifolds"
    return parts_block(what, record)


def batches_block(record: dict) -> str:
    """The times of a training step on a batch and on one large pair, and the ratios that were asked for."""
    config, results = record["config"], record["results"]
    lines = [
        f"Value and gradient of {config['pairs']} pairs of {config['points']} points in R³, and of one large pair, "
        f"float32, {config['directions']} directions. Medians of {config['repeats']}, written by `{record['command']}` "
        f"on {record['date']} ({record['machine']}, {record['processor']}).",
        "",
        "| part | CPU s | wall s |",
        "|---|---|---|",
    ]
    rows = results["parts"]
    lines += [f"| {row['part']} | {digits(row['CPU s'], 2)} | {digits(row['wall s'], 2)} |" for row in rows]
    lines += ["", "| CPU time over that of ours | found | target | |", "|---|---|---|---|"]
    for row in results["targets"]:
        verdict = "met" if row["met"] else "missed"
        lines.append(f"| {row['what']} | {digits(row['found'], 3)} × | ≥ {digits(row['at_least'])} × | {verdict} |")
    return "\n".join(lines)


def study_block(record: dict) -> str:
    """The measured cost of a scan, and what studies of several sizes cost at that rate."""
    config, scan = record["config"], record["results"]["scan"]
    what = "`meshot reconstruct` on the MNI152 average" + (", without the flow" if config["initial_only"] else "")
    lines = [
        f"{what}, one thread, from the start of the command to its end. Medians of {config['repeats']}, written by "
        f"`{record['command']}` on {record['date']} ({record['machine']}). A scan takes {_round(scan['CPU s'])} "
        f"processor seconds and {_round(scan['memory MB'])} MB of memory, and leaves {_round(scan['files MB'])} MB of "
        "files. The table has multiples of this.",
        "",
        f"| scans | core hours | on {LAPTOP_CORES} cores | on {CLUSTER_CORES} cores | files |",
        "|---|---|---|---|---|",
    ]
    for n_scans in STUDY_SIZES:
        hours, files = n_scans * scan["CPU s"] / 3600, n_scans * scan["files MB"]
        times = " | ".join(_time(hours / cores) for cores in (LAPTOP_CORES, CLUSTER_CORES))
        lines.append(f"| {n_scans:,} | {_round(hours)} | {times} | {_round(files / 1000)} GB |".replace(",", "\u202f"))
    return "\n".join(lines)


def _round(value: float) -> str:
    """Two significant digits without an exponent."""
    return f"{float(f'{value:.2g}'):,.10g}".replace(",", "\u202f")


def _time(hours: float) -> str:
    if hours >= 48:
        return f"{_round(hours / 24)} days"
    return f"{_round(hours)} hours" if hours >= 2 else f"{_round(60 * hours)} minutes"


def parts_block(what: str, record: dict) -> str:
    """The times of all parts, and the target."""
    asked = "; ".join(
        f"{target['what']}, within {digits(target['limit_s'])} s ({'met' if target['met'] else 'missed'})"
        for target in record["results"]["targets"]
    )
    lines = [
        f"{what}. Medians of {record['config']['repeats']}, written by `{record['command']}` on {record['date']} "
        f"({record['machine']}). Asked for: {asked}.",
        "",
        "| part | CPU s | wall s |",
        "|---|---|---|",
    ]
    rows = record["results"]["parts"]
    lines += [f"| {row['part']} | {digits(row['CPU s'], 2)} | {digits(row['wall s'], 2)} |" for row in rows]
    return "\n".join(lines)


#: Numbers of scans and of cores in the table of what a study costs.
STUDY_SIZES, LAPTOP_CORES, CLUSTER_CORES = (1000, 100_000), 8, 512

BLOCKS = {
    "benchmark": (COST / "results.json", losses_block),
    "ruler": (COST / "ruler.json", ruler_block),
    "windows": (COST / "windows.json", windows_block),
    "batches": (COST / "batches.json", batches_block),
    "reconstruction": (COST / "reconstruction.json", reconstruction_block),
    "study": (COST / "study.json", study_block),
}


def with_block(text: str, name: str, block: str) -> str:
    """The text with the block between the markers of a name replaced."""
    begin, end = (marker.format(name) for marker in MARKERS)
    if begin not in text or end not in text:
        raise ValueError(f"{PAGE.name} has no {begin} ... {end}; put both lines where the table shall stand")
    return f"{text[: text.index(begin)]}{begin}\n{block}\n{text[text.index(end) :]}"


def written(text: str) -> str:
    """The text with every block updated from the stored results."""
    for name, (results, block) in BLOCKS.items():
        text = with_block(text, name, block(read_results(results)))
    return text


if __name__ == "__main__":
    made = written(PAGE.read_text(encoding="utf-8"))
    write_whole(PAGE, made)
    print("wrote book/speed.md")
