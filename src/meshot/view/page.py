"""HTML output for notebooks and the book: HTML, CSS and JavaScript files filled with data.

A file is named by its path in the packages, such as ``meshot/view/assets/page.html``. A filled page includes its styles
and scripts. It needs no network and no other file, in JupyterLab and in the book opened from file://.
"""

import base64
import dataclasses
import hashlib
import io
import os
import posixpath
import re
from collections.abc import Sequence
from importlib import resources

import jinja2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from meshot.files import whole_file
from meshot.view.style import BLUE, ORANGE, SKY, VERMILLION, WIDTH

_IMPORT = re.compile(r"""^(?:@import|import\s[^;]*?\sfrom) "([^"]+)";\n""", re.MULTILINE)
_INDENT = re.compile(r"\s*\n\s*")
_COMMENT = re.compile(
    r"^\s*(?:export (?=(?:async )?(?:function|const|class))|//.*\n|/\*(?:[^*]|\*(?!/))*\*/\n)", re.MULTILINE
)


@dataclasses.dataclass(frozen=True, eq=False)
class Page:
    """A piece of HTML that is shown in notebooks and the book.

    Parameters
    ----------
    html : str
        Self-contained: a static image, and the script of the interactive view.
    words : str
        The text shown where HTML is not available.
    """

    html: str
    words: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.words


def live_page(stem: str, data: dict, words: str, *, script: str | None = None, **values: object) -> Page:
    """A page with data: the template ``stem.html``, which extends ``page.html``, with ``stem.css`` and ``stem.js``.

    The script must export ``main(root, data)``, where root is the outermost element of the page. The template has the
    name of that element in ``id``, which depends only on the content of the page.

    Parameters
    ----------
    stem : str
        Path without suffix.
    data : dict
        Plain, finite values, for JSON.
    words : str
        The text shown where HTML is not available.
    script : str, optional
        Path of the script without suffix, where several pages share template and style.
    **values
        The other variables of the template; ``alt`` is always required.
    """
    script = script or stem
    kind = posixpath.basename(script).replace("_", "-")
    name = f"{kind}-" + hashlib.sha256(repr((data, values)).encode()).hexdigest()[:12]
    html = filled(f"{stem}.html", stem=stem, script=script, kind=kind, id=name, data=data, **values)
    return Page(_INDENT.sub("\n", html), words)


def filled(template: str, **values: object) -> str:
    """The template with every value filled in and escaped. ``tojson`` writes data that cannot end a script element.

    Raises
    ------
    jinja2.UndefinedError
        If a variable of the template is not given.
    """
    return _TEMPLATES.get_template(template).render(values)


def joined(*names: str) -> str:
    """Scripts or styles joined with everything that they import, each once and after its own imports."""
    # Comments on lines of their own, indents and the words ``import`` and ``export`` are removed; all parts share one
    # scope.
    parts: dict[str, str] = {}

    def add(name: str) -> None:
        if name not in parts:
            parts[name] = ""
            text = _text(name)
            for other in _IMPORT.findall(text):
                add(posixpath.normpath(posixpath.join(posixpath.dirname(name), other)))
            del parts[name]
            parts[name] = _INDENT.sub("\n", _COMMENT.sub("", _IMPORT.sub("", text))).strip()

    for name in names:
        add(name)
    return "\n".join(parts.values())


def still_of(figure: Figure) -> str:
    """The figure as a PNG in base64. The figure is closed."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    plt.close(figure)
    return base64.b64encode(buffer.getvalue()).decode()


def _text(name: str) -> str:
    package, *path = name.split("/")
    return resources.files(package).joinpath(*path).read_text(encoding="utf-8")


_TEMPLATES = jinja2.Environment(
    loader=jinja2.FunctionLoader(_text),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_TEMPLATES.globals["joined"] = joined
_TEMPLATES.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}


# Figures of a training: loss and validation metrics over the steps.


def training_figure(log: Sequence[dict]) -> Figure:
    """The loss of every step with its running mean, and below it the validation: Dice, distances in mm, or the loss.

    The log is that of a :class:`meshot.train.Training`.

    Raises
    ------
    ValueError
        If the log has no step.
    """
    steps = [line for line in log if "loss" in line]
    checks = [line for line in log if "validation_loss" in line]
    if not steps:
        raise ValueError("the log holds no step: nothing was trained yet")
    measured = set().union(*checks)
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(WIDTH, 6.4), layout="constrained", sharex=True)
    at, losses = np.array([line["step"] for line in steps]), np.array([line["loss"] for line in steps])
    width = max(1, len(at) // 30)
    upper.semilogy(at, losses, color=SKY, linewidth=0.6 if width > 1 else 2, label="one step")
    if width > 1:
        mean = np.convolve(losses, np.ones(width) / width, "valid")
        upper.semilogy(at[width - 1 :], mean, color=BLUE, label=f"mean of {width} steps")
    checked = [line["step"] for line in checks]
    upper.set(ylabel="loss")
    if "hausdorff90_mm" in measured:
        for key, name, colour, dashes in (
            ("hausdorff90_mm", "Hausdorff at 90 %", ORANGE, "--"),
            ("validation_loss", "ASSD", BLUE, "-"),
        ):
            lower.plot(checked, [line[key] for line in checks], dashes, marker=".", color=colour, label=name)
        lower.set(ylabel="on validation (mm)", ylim=(0, None))
    elif "dice_left" in measured:
        upper.semilogy(checked, [line["validation_loss"] for line in checks], "o-", color=ORANGE, label="validation")
        upper.set(ylabel="cross-entropy + 1 − Dice")
        for side, colour, dashes in (("left", VERMILLION, "-"), ("right", BLUE, "--")):
            dice = [line[f"dice_{side}"] for line in checks]
            lower.plot(checked, dice, dashes, marker=".", color=colour, label=side)
        lower.set(ylabel="Dice on validation", ylim=(None, 1.0))
    else:
        lower.plot(checked, [line["validation_loss"] for line in checks], "o-", color=ORANGE, label="validation")
        lower.set(ylabel="loss of the validation")
    # Ticks of the logarithmic axis as plain numbers, also between the powers of ten where there are few of them.
    low, high = upper.get_ylim()
    upper.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,)))
    upper.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    upper.yaxis.set_minor_locator(NullLocator())
    lower.set_xlabel("step")
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    upper.legend()
    if checks:
        lower.legend()
    return figure


def write_training_figure(path: str | os.PathLike, log: Sequence[dict]) -> None:
    """Write the picture of a log to a file, completely or not at all."""
    figure = training_figure(log)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=120)
    plt.close(figure)
