"""One page about a reconstruction: whole in itself, offline, light or dark, on wide and on narrow screens."""

import html
from collections.abc import Sequence

from meshot.pipeline.report.pictures import Picture

_STYLE = """
:root { color-scheme: light dark; --ground: #fff; --text: #1d2329; --line: #c9d0d6; --soft: #f1f4f6;
  --loud: #8a2d00; --loud-ground: #fff1e8; }
@media (prefers-color-scheme: dark) { :root { --ground: #14181e; --text: #dbe2e8; --line: #434c55; --soft: #1e242b;
  --loud: #ffb184; --loud-ground: #3a2114; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; background: var(--ground); color: var(--text);
  font: 1rem/1.5 system-ui, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; margin: .2rem 0 .6rem; } h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; }
.loud { border-left: .4rem solid var(--loud); background: var(--loud-ground); padding: .5rem 1rem; margin: 1rem 0; }
.loud strong { color: var(--loud); } .loud ul { margin: .3rem 0; padding-left: 1.2rem; }
.slices { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(20rem, 100%), 1fr)); gap: .8rem; }
.slices img { width: 100%; height: auto; background: #fff; border-radius: .3rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
.wide { margin: .8rem 0; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th:first-child { text-align: left; font-weight: 400; white-space: normal; min-width: 9rem; }
thead th { font-weight: 600; }
details { margin: .6rem 0; } summary { cursor: pointer; font-weight: 600; }
pre { background: var(--soft); padding: .6rem; overflow-x: auto; font-size: .85rem; }
figure { margin: 0; }
"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>White surfaces of {name}</title>
<style>{style}</style>
</head>
<body>
<header>
<h1>White surfaces of {name}</h1>
<p class="loud"><strong>Not for clinical use.</strong> Made by research software (meshot), whose networks may never have
seen a scan like this one. Nobody has checked these surfaces: look at them before you use them for anything.</p>
</header>
<main>
{warnings}
<h2>Slices</h2>
<p>Through the scan as it came; right is on the right, in mm of the scanner. Does the line follow the border between
white and grey matter, also in the depths?</p>
<div class="slices">
{images}
</div>
<h2>Surfaces</h2>
<p>{flow}</p>
{view}
<h2>Numbers</h2>
{numbers}
<h2>How it was made</h2>
{making}
</main>
</body>
</html>
"""


def reconstruction_page(report: dict, slices: Sequence[Picture], view: str) -> str:
    """The page, HTML.

    Parameters
    ----------
    report : dict
        As :func:`meshot.pipeline.report.write_reconstruction` writes it to ``report.json``.
    slices : sequence of Picture
    view : str
        HTML of the surfaces.
    """
    images = "\n".join(
        f'<img alt="{html.escape(p.alt, quote=True)}" src="data:image/png;base64,{p.png}">' for p in slices
    )
    flow = (
        "Coloured by how far each place is from the initial surface."
        if report["system"]
        else "No system was asked for: the initial surfaces are the result."
    )
    return _PAGE.format(
        name=html.escape(report["scan"]["name"]), style=_STYLE, warnings=_warnings(report["warnings"]), images=images,
        flow=flow, view=view, numbers=_numbers(report), making=_making(report),
    )  # fmt: skip


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return "<p>No warning: nothing that is checked looks odd. Errors that are not checked for can be there.</p>"
    items = "".join(f"<li>{html.escape(warning)}</li>" for warning in warnings)
    return f'<div class="loud" role="alert"><strong>Warnings</strong><ul>{items}</ul></div>'


def _numbers(report: dict) -> str:
    surfaces = report["surfaces"]
    meshes = [
        ("vertices", "n_vertices"), ("faces", "n_faces"), ("Euler number χ (a sphere has 2)", "euler_number"),
        ("edges of one face only", "n_boundary_edges"), ("edges of more than two faces", "n_nonmanifold_edges"),
        ("self-intersecting faces", "n_self_intersecting_faces"),
        ("volume inside (cm³)", "volume_cm3"), ("area (cm²)", "area_cm2"),
    ]  # fmt: skip
    stages = ("initial", "final") if report["system"] else ("initial",)
    columns = [(side, stage) for side in surfaces for stage in stages]
    rows = [(label, *(surfaces[side][stage][key] for side, stage in columns)) for label, key in meshes]
    first = _table(["", *(f"{side}, {stage}" for side, stage in columns)], rows)
    rows = []
    if report["system"]:
        words = {"mean": "mean", "percentile_95": "95 % below", "largest": "largest"}
        rows = [
            (f"distance from the initial surface, {word} (mm)",
             *(surfaces[side]["distance_from_initial_mm"][key] for side in surfaces))
            for key, word in words.items()
        ]  # fmt: skip
    mending = [surfaces[side]["mending"] for side in surfaces]
    if all(mending):
        rows += [
            ("faces that crossed after the flow, before mending", *(m["n_faces_crossing_before"] for m in mending)),
            ("largest move by mending (mm)", *(m["largest_move_mm"] for m in mending)),
        ]
    rows += [
        ("voxels given up for the topology of a ball", *(surfaces[side]["n_voxels_given_up"] for side in surfaces)),
        ("these, of the white matter (%)", *(100 * surfaces[side]["share_of_voxels_given_up"] for side in surfaces)),
    ]
    return first + _table(["", *surfaces], rows)


def _making(report: dict) -> str:
    scan, seconds = report["scan"], report["seconds"]
    size = " × ".join(map(str, scan["n_voxels"])) + " voxels of " + " × ".join(f"{v:g}" for v in scan["voxel_mm"])
    rows = [(stage, seconds["processor"][stage], seconds["clock"][stage]) for stage in seconds["processor"]]
    rows.append(("in all", sum(seconds["processor"].values()), sum(seconds["clock"].values())))
    timing = _table(["stage", "processor (s)", "clock (s)"], rows)
    matrix = "\n".join(" ".join(f"{value:11.6f}" for value in row) for row in report["to_standard"])
    records = "\n".join(f"{name}: {_record(record)}" for name, record in report["weights"].items())
    versions = ", ".join(f"{name} {version}" for name, version in report["versions"].items())
    system = f"system {html.escape(report['system'])}" if report["system"] else "initial surfaces only"
    return f"""<p>Scan: {size} mm; {system}; {report["date"]}.</p>
{timing}
<details><summary>Transform, weights, versions</summary>
<p>From scanner RAS of the scan to MNI152, in mm:</p>
<pre>{matrix}</pre>
<p>Trained weights, in full in report.json:</p>
<pre>{html.escape(records)}</pre>
<p>meshot at commit {html.escape(report["commit"])}; {html.escape(versions)}; {html.escape(report["machine"])}.</p>
</details>
<details><summary>Files beside this page</summary>
<ul><li>lh.white, rh.white: the surfaces, for FreeSurfer; the same as .surf.gii (GIfTI) and .ply; in scanner RAS</li>
<li>lh.initial, rh.initial: the initial surfaces, likewise</li>
<li>to_standard.json: the transform; report.json: every number; timing.json: seconds of each stage</li></ul>
</details>"""


def _record(record: dict) -> str:
    known = [f"{key} {record[key]}" for key in ("commit", "date", "cohorts", "command") if key in record]
    return "; ".join(known) or "no record"


def _table(names: Sequence[str], rows: Sequence[tuple]) -> str:
    head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in names)
    body = "\n".join(
        f'<tr><th scope="row">{html.escape(str(label))}</th>'
        + "".join(f"<td>{_cell(v)}</td>" for v in values)
        + "</tr>"
        for label, *values in rows
    )
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>\n'


def _cell(value: float) -> str:
    if isinstance(value, float) and not abs(value) >= 1000:
        text = f"{value:.3g}"
        return "0" if float(text) == 0 else text  # never a minus zero
    return f"{round(value):,}".replace(",", "\u202f")
