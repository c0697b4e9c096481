"""Claims 20 and 22: the effect of a fixed number of support points, and of the loss on mesh regularity."""

from meshot_book.claims.ledger import ASSUMING, CHOICE, IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

ANALYTIC = "folded"
EVENNESS = ("edge_variation", "area_variation")
CLOCKS = ("steps", "seconds", "closeness")
STEADY = 1.1  # memory up to this multiple of that on the previous mesh counts as constant
LOSSES = {"sliced": "sliced Wasserstein", "chamfer": "Chamfer"}


def evenness_verdict(record: dict) -> Verdict:
    """Claim 22 from ``experiments/deforming``: Chamfer minus sliced Wasserstein in the variation of edges and areas.

    All comparisons with an interval over seeds count, on the analytic surfaces and on the cortex. A loss leads after
    equal steps, after equal seconds or at equal closeness if it is more even in more comparisons than the other.
    """
    rows = [row for row in record["results"]["differences"] if row["edge_variation_low"] is not None]
    tallies = {at: _tally([row for row in rows if row["at"] == at]) for at in CLOCKS}
    leads = [tally["sliced"] > tally["chamfer"] for tally in tallies.values()]
    status = CHOICE if any(leads) else NOT_REPRODUCED
    if all(leads):
        always = all(tally["sliced"] == tally["all"] for tally in tallies.values())
        status = REPRODUCED if always else IN_PART
    close, steps = tallies["closeness"], tallies["steps"]
    return Verdict(
        status=status,
        says=(
            f"After equal steps sliced Wasserstein leaves more even triangles in {steps['sliced']} of {steps['all']} "
            f"comparisons and Chamfer in {steps['chamfer']}. At equal closeness it is {close['sliced']} against "
            f"{close['chamfer']}{_identical(close)}. The paper does not say which it compares."
        ),
        headline=(f"{close['sliced']} of {close['all']}", "comparisons at equal closeness with more even triangles"),
        ours=_evenness_sentence(rows, tallies) + _by_rate(record["results"]),
        tolerance=(
            "a comparison (surface × start × encoding × supports) is decided for a loss if the 95 % intervals over "
            "seeds of the differences in the variation of edge lengths and of face areas both have the sign that "
            "favours it. Reproduced if all are decided for sliced Wasserstein, after equal steps, after equal seconds "
            "and at equal closeness; in part if under all three more are decided for it than for Chamfer; depending "
            "on a choice if under some. Comparisons with one seed have no interval and do not count"
        ),
        numbers=markdown_table([_evenness_row(row) for row in record["results"]["differences"]]),
    )


def _tally(rows: list[dict]) -> dict[str, int]:
    """The number of comparisons in which each loss gives more even triangles, and the number of all."""
    sliced, chamfer = (len(_more_even(rows, end, sign)) for end, sign in (("low", 1), ("high", -1)))
    same = sum(all(row[f"{name}_gap"] == 0 for name in EVENNESS) for row in rows)
    return {"sliced": sliced, "chamfer": chamfer, "same": same, "all": len(rows)}


def _identical(tally: dict[str, int]) -> str:
    """How many comparisons are between identical meshes: neither fit came nearer than its start."""
    return f" ({tally['same']} of {tally['all']} compare identical meshes)" if tally["same"] else ""


def _more_even(rows: list[dict], end: str, sign: int) -> list[dict]:
    """The rows in which the whole interval of the variation, in edges and in areas, is on one side of zero."""
    return [row for row in rows if all(sign * row[f"{name}_{end}"] > 0 for name in EVENNESS)]


def _evenness_sentence(rows: list[dict], tallies: dict[str, dict[str, int]]) -> str:
    """The first setting in numbers, the tallies by kind of equality and for the cortex, and the closeness."""
    first = next(row for row in rows if row["target"] == ANALYTIC)
    ended = [row for row in rows if row["at"] != "closeness"]
    nearer, farther = (sum(sign * row[end] > 0 for row in ended) for end, sign in (("assd_low", 1), ("assd_high", -1)))
    by_clock = "; ".join(
        f"equal {at}: {tally['sliced']} against {tally['chamfer']} of {tally['all']}{_identical(tally)}"
        for at, tally in tallies.items()
    )
    cortex = _tally([row for row in rows if row["target"] != ANALYTIC])
    return (
        f"Edge length variation {digits(first['edge_variation_sliced'], 3)} with sliced Wasserstein against "
        f"{digits(first['edge_variation_chamfer'], 3)} with Chamfer ({_name(first)}; equal {first['at']}), ASSD "
        f"{digits(first['assd_sliced'], 3)} against {digits(first['assd_chamfer'], 3)} mm. More even triangles, sliced "
        f"Wasserstein against Chamfer: {by_clock}. On the cortex alone {cortex['sliced']} against {cortex['chamfer']} "
        f"of {cortex['all']}. After equal steps or seconds sliced Wasserstein ends nearer in {nearer} and farther in "
        f"{farther} of {len(ended)}"
    )


def _by_rate(results: dict) -> str:
    """What the trials of learning rates found, on one seed."""
    tried = [row for row in results["rates"] if (row["encoding"], row["supports"]) == ("varifold", "full")]
    each = [
        f"{row['loss']} {row['learning_rate']:g}: {digits(row['assd'], 3)} mm, {digits(row['edge_variation'], 3)}"
        for row in tried
    ]
    return f". ASSD and edge length variation by learning rate (varifold, one seed): {'; '.join(each)}"


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
            "Memory grows with the mesh if every face is a support; with a fixed number of supports, drawn before the "
            f"flow, it {'stays constant' if mended else 'still grows'}{', and the error is larger' if dearer else ''}."
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
