"""Claims 20 and 22: the effect of a fixed number of support points, and of the loss on mesh regularity."""

from meshot_book.claims.ledger import ASSUMING, IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

ANALYTIC = "folded"
EVENNESS = ("edge_variation", "area_variation")
STEADY = 1.1  # memory up to this multiple of that on the previous mesh counts as constant
LOSSES = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}


def evenness_verdict(record: dict) -> Verdict:
    """Claim 22 from ``experiments/deforming``: Chamfer minus sliced Wasserstein in the variation of edges and areas.

    The verdict uses the analytic target, which has several seeds, after equal steps and after equal time.
    """
    rows = [row for row in record["results"]["differences"] if row["target"] == ANALYTIC and row["at"] != "closeness"]
    even = _more_even(rows, "low", 1)
    close = [row for row in record["results"]["differences"] if row["target"] == ANALYTIC and row["at"] == "closeness"]
    status = IN_PART if even else NOT_REPRODUCED
    if len(even) == len(rows) and len(_more_even(close, "low", 1)) == len(close):
        status = REPRODUCED
    return Verdict(
        status=status,
        says=_evenness_verdict_in_words(record["results"]["differences"], rows, even),
        headline=(f"{len(even)} of {len(rows)}", "comparisons at equal steps or seconds with more even triangles"),
        ours=_evenness_sentence(record["results"]["differences"], rows, even),
        tolerance=(
            "reproduced if in every comparison on the analytic target (start × encoding × supports × equal steps, "
            "seconds or closeness) the 95 % interval over seeds of Chamfer minus sliced Wasserstein lies above zero in "
            "the variation of edge lengths and in that of face areas; in part if in some at equal steps or seconds"
        ),
        numbers=markdown_table([_evenness_row(row) for row in record["results"]["differences"]]),
    )


def _evenness_verdict_in_words(differences: list[dict], rows: list[dict], even: list[dict]) -> str:
    close = [row for row in differences if row["target"] == ANALYTIC and row["at"] == "closeness"]
    farther = [row for row in rows if row["assd_high"] < 0]
    sliced, chamfer = (len(_more_even(close, end, sign)) for end, sign in (("low", 1), ("high", -1)))
    return (
        f"After equal steps or seconds sliced Wasserstein leaves more even triangles in {len(even)} of {len(rows)} "
        f"comparisons, and ends farther from the target in {len(farther)}; at equal closeness its triangles are more "
        f"even in {sliced} of {len(close)}, those of Chamfer in {chamfer}."
    )


def _more_even(rows: list[dict], end: str, sign: int) -> list[dict]:
    """The rows in which the whole interval of the variation, in edges and in areas, is on one side of zero."""
    return [row for row in rows if all(sign * row[f"{name}_{end}"] > 0 for name in EVENNESS)]


def _evenness_sentence(differences: list[dict], rows: list[dict], even: list[dict]) -> str:
    """A sentence with the settings where the claim holds, the first one in numbers, and the effect on closeness."""
    nearer = [row for row in rows if row["assd_low"] > 0]
    farther = [row for row in rows if row["assd_high"] < 0]
    close = [row for row in differences if row["target"] == ANALYTIC and row["at"] == "closeness"]
    still, turned = _more_even(close, "low", 1), _more_even(close, "high", -1)
    first, others = rows[0], dict.fromkeys(_name(row) for row in rows if row not in even)
    exceptions = f" (not all: {'; '.join(others)})" if others else ""
    return (
        f"Edge length variation {digits(first['edge_variation_sliced'], 3)} with sliced Wasserstein against "
        f"{digits(first['edge_variation_chamfer'], 3)} with Chamfer ({_name(first)}; equal steps), ASSD "
        f"{digits(first['assd_sliced'], 3)} against {digits(first['assd_chamfer'], 3)} mm. Sliced Wasserstein is more "
        f"even in {len(even)} of {len(rows)} comparisons{exceptions}. It ends nearer in {len(nearer)} and farther in "
        f"{len(farther)} of them. Where both are equally near, it is more even in {len(still)} of {len(close)}, "
        f"Chamfer in {len(turned)}"
    )


def _name(row: dict) -> str:
    supports = "all supports" if row["supports"] == "full" else f"{row['supports']} supports"
    return f"{row['start']}, {row['encoding']}, {supports}"


def _evenness_row(row: dict) -> dict:
    cells = {"target": row["target"].replace("_", " "), "start": row["start"], "encoding": row["encoding"]}
    cells |= {"supports": str(row["supports"]), "equal": row["at"]}
    for name, title in (("assd", "ASSD, mm"), ("edge_variation", "edges"), ("area_variation", "areas")):
        cells |= {f"{title}, {short}": digits(row[f"{name}_{loss}"], 3) for short, loss in _SHORT.items()}
        equal = name == "assd" and row["at"] == "closeness"
        cells[f"{title}, gap [95 %]"] = "–" if equal else _gap(row, name)
    return cells | {"seeds": str(row["n_seeds"])}


_SHORT = {"SW": "sliced", "Chamfer": "chamfer"}


def _gap(row: dict, name: str) -> str:
    gap, low, high = (row[f"{name}_{end}"] for end in ("gap", "low", "high"))
    interval = "" if low is None else f" [{low:+.3g}, {high:+.3g}]"
    return f"{gap:+.3g}{interval}"


def supports_verdict(record: dict) -> Verdict:
    """Claim 20 from ``experiments/fixed_supports``: does memory grow with the mesh, unless supports are fixed?"""
    grows = all(_growth(record, loss, "all") > STEADY for loss in LOSSES)
    mended = all(_growth(record, loss, "carried") <= STEADY for loss in LOSSES)
    dearer = any(r["variant"] == "carried" and r["assd_low"] > 0 for r in record["results"]["differences"])
    status = NOT_REPRODUCED if not grows else (ASSUMING if mended else REPRODUCED)
    return Verdict(
        status=status,
        says=(
            "Memory grows with the mesh as long as the supports do; with a fixed number of supports, drawn before the "
            f"flow, it {'stays as it is' if mended else 'still grows'}{', and the error is larger' if dearer else ''}."
        ),
        headline=(
            f"{_growth(record, 'sliced', 'all'):.2g} against {_growth(record, 'sliced', 'carried'):.2g} times",
            "growth of memory with four times the faces: all supports, against a fixed number",
        ),
        ours=_supports_sentence(record),
        tolerance=(
            "from the last mesh but one to the last: not reproduced if the memory of a step with all supports stays "
            f"within {STEADY:g} times; under a further assumption (that the number of supports is not fixed) if with a "
            "fixed number, drawn before the flow, it does; reproduced otherwise"
        ),
        numbers=markdown_table(_cost_rows(record)) + "\n\n" + markdown_table(_fit_rows(record)),
    )


_VARIANTS = {"all": "all faces", "drawn": "drawn after the flow", "carried": "drawn before the flow"}
_NAMES = _VARIANTS | {"through": "drawn after the flow, gradients through the areas"}


def _costs(record: dict, loss: str, variant: str) -> list[dict]:
    rows = [r for r in record["results"]["costs"] if (r["loss"], r["variant"]) == (loss, variant)]
    return sorted(rows, key=lambda row: row["n_faces"])


def _growth(record: dict, loss: str, variant: str) -> float:
    """The ratio of a step's memory on the largest mesh and on the one before. Small meshes have shared corners."""
    before, last = _costs(record, loss, variant)[-2:]
    return last["step_bytes"] / before["step_bytes"]


def _supports_sentence(record: dict) -> str:
    before, last = (row["n_faces"] for row in _costs(record, "sliced", "all")[-2:])
    grown = {
        loss: ", ".join(f"{_growth(record, loss, variant):.3g} ({name})" for variant, name in _VARIANTS.items())
        for loss in LOSSES
    }
    changes = ", ".join(
        f"{row['n_supports']} {_NAMES[row['variant']]} ({row['assd_gap']:+.3f} "
        f"[{row['assd_low']:+.3f}, {row['assd_high']:+.3f}])"
        for row in record["results"]["differences"]
    )
    whole = record["results"]["fits"][0]
    return (
        f"From {before} to {last} faces the memory of a step grows by a factor of {grown['sliced']} under sliced "
        f"Wasserstein, {grown['chamfer']} under Chamfer. ASSD at equal steps: {digits(whole['assd_mean'], 3)} mm with "
        f"all {whole['n_supports']}; with fewer, change [95 %] in mm: {changes}"
    )


def _cost_rows(record: dict) -> list[dict]:
    rows = []
    for loss in LOSSES:
        for variant, name in _VARIANTS.items():
            for row in _costs(record, loss, variant):
                cells = {"loss": LOSSES[loss], "supports": name, "faces": str(row["n_faces"])}
                for part in ("step", "loss"):
                    cells |= {f"{part}, MB": digits(row[f"{part}_bytes"] / 1e6, 3)}
                    cells |= {f"{part}, CPU s": digits(row[f"{part}_seconds"], 3)}
                rows.append(cells)
    return rows


def _fit_rows(record: dict) -> list[dict]:
    rows = []
    for row in record["results"]["fits"]:
        cells = {"supports": _NAMES[row["variant"]], "number": str(row["n_supports"])}
        for name, title in (("assd", "ASSD, mm"), ("edge_variation", "edge length variation")):
            cells[title] = f"{digits(row[f'{name}_mean'], 3)} ± {digits(row[f'{name}_sd'], 2)}"
        rows.append(cells | {"crossing faces": digits(row["intersecting_faces_mean"], 3), "seeds": str(row["n_seeds"])})
    return rows
