"""HTML output for notebooks and the book: HTML, CSS and JavaScript files filled with data.

A file is named by its path in the packages, such as ``meshot/view/assets/page.html``. A filled page includes its styles
and scripts. It needs no network and no other file, in JupyterLab and in the book opened from file://.
"""

import base64
import dataclasses
import hashlib
import io
import posixpath
import re
from importlib import resources

import jinja2
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

_IMPORT = re.compile(r"""^(?:@import|import\s[^;]*?\sfrom) "([^"]+)";\n""", re.MULTILINE)
_QUOTED = re.compile(r"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|`(?:\\.|[^`\\])*`)""")
#: Where white space outside quotes is redundant. The code formatter ends every statement with a semicolon.
_LOOSE = {
    ".js": re.compile(r"\s*([][{}();,:=<>?&|*/%])\s*| ?([+-]) (?![+-])"),
    ".css": re.compile(r"\s*([{};,>])\s*|(?<=:)()\s+"),
}
_INDENT = re.compile(r"\s*\n\s*")
_COMMENT = re.compile(r"^\s*(?:export (?=(?:async )?(?:function|const|class))|//.*\n|/\*.*\*/\n)", re.MULTILINE)


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


def live_page(stem: str, data: dict, words: str, **values: object) -> Page:
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
    **values
        The other variables of the template; ``alt`` is always required.
    """
    kind = posixpath.basename(stem).replace("_", "-")
    name = f"{kind}-" + hashlib.sha256(repr((data, values)).encode()).hexdigest()[:12]
    html = filled(f"{stem}.html", stem=stem, kind=kind, id=name, data=data, **values)
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
    """Scripts or styles joined with everything that they import, each once and after its own imports.

    Comments, redundant white space and the words ``import`` and ``export`` are removed; all parts share one scope. A
    comment must be on a line of its own.
    """
    parts: dict[str, str] = {}

    def add(name: str) -> None:
        if name not in parts:
            parts[name] = ""
            text = _text(name)
            for other in _IMPORT.findall(text):
                add(posixpath.normpath(posixpath.join(posixpath.dirname(name), other)))
            del parts[name]
            parts[name] = _squeezed(_IMPORT.sub("", text), _LOOSE[posixpath.splitext(name)[1]])

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


def _squeezed(text: str, loose: re.Pattern) -> str:
    pieces = _QUOTED.split(_COMMENT.sub("", text))
    return "".join(piece if i % 2 else loose.sub(r"\1\2", piece) for i, piece in enumerate(pieces)).strip()


_TEMPLATES = jinja2.Environment(
    loader=jinja2.FunctionLoader(_text),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_TEMPLATES.globals["joined"] = joined
_TEMPLATES.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
