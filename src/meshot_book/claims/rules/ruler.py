"""Claims 14 and 15: the paper's numbers, compared with floors and inequalities."""

from meshot_book.claims.ledger import CHOICE, IN_PART, NOT_REPRODUCED, REPRODUCED, Verdict
from meshot_book.notebook import digits, markdown_table

USABLE = 0.5  # if the floor is at most this share of a number, three quarters of its square are due to the surfaces
STRIKING = 3  # smallest ratio of a column's second smallest deviation to its smallest that is reported


def table_verdict(record: dict) -> Verdict:
    """Claim 14 from ``experiments/paper_table``: are the EMD and SWD columns consistent?

    On the same points SW₂ ≤ W₂/√3, up to the error of the directions. The columns are consistent if, under one
    convention (exponent, root, half), every row satisfies its inequality.
    """
    table = record["results"]["table"]
    printed, swapped = (min(table[key], key=lambda row: row["n_broken"]) for key in ("as_printed", "oasis_exchanged"))
    status = NOT_REPRODUCED if swapped["n_broken"] else IN_PART
    if not printed["n_broken"]:
        status = REPRODUCED
    rooted = {key: table[key][0] for key in ("as_printed", "oasis_exchanged")}
    pattern = "; ".join(
        f"{row['cohort']}: EMD above SWD in {row['emd_above_swd']} of {row['n_rows']} rows, its deviation below in "
        f"{row['emd_sd_below_swd_sd']}"
        for row in table["pattern"]
    )
    return Verdict(
        status=status,
        says=(
            f"Under the most lenient reading of the columns {_broken(printed)} rows contradict $\\SW_2 \\le "
            f"\\W_2/\\sqrt 3$, and {swapped['n_broken']} still do if the two OASIS columns are exchanged."
        ),
        headline=(_broken(printed), "rows of the tables that contradict $\\SW_2 \\le \\W_2/\\sqrt 3$"),
        ours=(
            f"as rooted distances {_broken(rooted['as_printed'])} break SW₂ ≤ W₂/√3, with the OASIS columns exchanged "
            f"{_broken(rooted['oasis_exchanged'])}; under the most lenient reading {_broken(printed)}, exchanged "
            f"{_broken(swapped)}. {pattern}"
        ),
        tolerance=(
            "reproduced if under one of the readings (exponent, root, half) all rows obey the inequality, up to "
            f"rounding and a factor of {digits(table['allowance'], 3)} in SW₂² for the paper's number of random "
            "directions; in part if they do so once the two OASIS columns are exchanged"
        ),
        numbers=f"{_readings_table(table)}\n\n{_oddities_table(table)}",
    )


def _broken(row: dict) -> str:
    return f"{row['n_broken']} of {row['n_rows']}"


def _readings_table(table: dict) -> str:
    rows = []
    for printed, swapped in zip(table["as_printed"], table["oasis_exchanged"], strict=True):
        worst = max(swapped["broken"], key=swapped["broken"].get, default="–")
        rows.append(
            {
                "if the columns are": printed["convention"],
                "rows broken, as printed": _broken(printed),
                "rows broken, OASIS exchanged": _broken(swapped),
                "worst of these": worst,
                "by a factor of": digits(swapped["broken"][worst], 3) if worst != "–" else "–",
            }
        )
    return markdown_table(rows)


def _oddities_table(table: dict) -> str:
    rows = [
        {
            "odd": f"{row['table']}, {row['part']}: the smallest deviation of {row['column'].upper()}",
            "printed": f"± {digits(row['sd'], 3)} ({row['system']})",
            "beside": f"± {digits(row['next_sd'], 3)}, the next one up",
        }
        for row in table["deviations"]
        if row["factor"] > STRIKING
    ]
    for cell in table["printed_twice"]:
        if not cell["equal"]:
            first, second = digits(cell["table_1"], 3), digits(cell["table_3"], 3)
            rows.append(
                {"odd": f"the same cell twice: {cell['cell']}", "printed": f"{first} (Table 1)",
                 "beside": f"{second} (Table 3)"}
            )  # fmt: skip
    return markdown_table(rows)


def floor_verdict(record: dict) -> Verdict:
    """Claim 15 from ``experiments/floors``: does an EMD of .70 mm measure the quality of a surface?

    It does under an interpretation (which distance, which root) whose floor, from two samples of one surface, is at
    most half the number. Squares are additive, so that three quarters of its square are then due to the surfaces.
    """
    readings, number = record["results"]["readings"], record["results"]["number_mm"]
    usable = [row for row in readings if row["high"] <= USABLE * number]
    beyond = [row for row in readings if row["low"] >= number]
    status = NOT_REPRODUCED if not usable else (REPRODUCED if len(usable) == len(readings) else CHOICE)
    exact = readings[0]
    sliced = next(row for row in readings_of(record, "sw2"))
    return Verdict(
        status=status,
        says=(
            f"Two samples of one and the same surface are already {_span(exact)} mm apart in W₂ at 10⁵ points, so that "
            f"{number} mm {'can' if usable else 'cannot'} measure the quality of a surface"
            f"{' in some readings of EMD only' if usable else ''}."
        ),
        headline=(f"{_span(exact)} mm", "EMD of a perfect surface"),
        ours=(
            f"two samples of one white surface are {_span(exact)} mm apart in exact W₂ at 10⁵ points "
            f"(extrapolated), and {_span(sliced)} mm in SW₂ (measured); the floor is above {number} mm in "
            f"{len(beyond)} of {len(readings)} readings of EMD and at most half of it in {len(usable)}"
        ),
        tolerance=(
            f"reproduced if the floor is at most {USABLE:.0%} of {number} mm in every reading, depending on the choice "
            "of reading if in some; readings: exact W₂ and W₁, the root of half the squared cost, "
            "half the squared cost, and GeomLoss with its default blur in mm or in [-1, 1]"
        ),
        numbers=f"{_floor_table(readings)}\n\n{_metric_table(record)}",
    )


def readings_of(record: dict, metric: str) -> list[dict]:
    """The predictions of a metric at the target size, for every surface."""
    rows = [row for row in record["results"]["floors"] if row["metric"] == metric]
    return [row["at_target"]["measured"] for row in rows if "measured" in row["at_target"]]


def _span(row: dict) -> str:
    return f"{digits(row['low'], 3)} to {digits(row['high'], 3)}"


def _floor_table(readings: list[dict]) -> str:
    return markdown_table(
        [
            {
                "EMD read as": row["reading"],
                "a perfect surface scores": _span(row) + f" {row['unit']}",
                "how": row["how"],
            }
            for row in readings
        ]
    )


def _metric_table(record: dict) -> str:
    names = {"sw2": "SW₂", "point_to_point": "ASSD to the nearest point", "point_to_face": "ASSD to the faces"}
    rows = []
    for metric, name in names.items():
        values = readings_of(record, metric)
        low, high = min(v["low"] for v in values), max(v["high"] for v in values)
        shown = f"{digits(low, 3)} to {digits(high, 3)}" if high > 1e-9 else "0 (rounding)"
        rows.append({"floor of": name, "four surfaces (mm)": shown, "how": "measured at 10⁵ points"})
    return markdown_table(rows)
