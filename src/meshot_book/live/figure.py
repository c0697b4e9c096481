"""The door of live figures: a script of the book, its data, and the words around it."""

import dataclasses
from collections.abc import Sequence
from importlib import resources

from matplotlib.figure import Figure

from meshot.view import Page, live_page, still_of


@dataclasses.dataclass(frozen=True)
class Answer:
    """One answer to the question above a live figure.

    Parameters
    ----------
    text : str
        The answer.
    because : str
        What a reader is told who chose it: why it is right, or what contradicts it.
    right : bool
        Whether it is right.
    """

    text: str
    because: str
    right: bool = False


def live_figure(
    name: str,
    data: dict,
    *,
    question: str,
    answers: Sequence[Answer],
    seen: str,
    still: Figure,
    alt: str,
    hint: str = "Drag points, or focus them and use the arrow keys; Page Up and Page Down choose another one.",
) -> Page:
    """A live figure of the book: a question, plots with controls, and what should have been seen.

    A still picture comes first, and stays in print and where scripts may not run. Nothing moves by itself.

    Parameters
    ----------
    name : str
        Of the script ``meshot_book/live/figures/assets/NAME.js``, which exports ``main(root, data)``.
    data : dict
        Plain, finite values for the script.
    question : str
        What a reader should predict before trying.
    answers : sequence of Answer
        Two or three, of which one is right.
    seen : str
        What a reader should have seen, shown on demand.
    still : Figure
        The picture that stands for the figure. It is closed.
    alt : str
        What the picture shows, for those who do not see it.
    hint : str
        How points are moved.

    Raises
    ------
    ValueError
        If there is no such figure, a text is empty, or not exactly one of two or three answers is right.
    """
    names = figure_names()
    if name not in names:
        raise ValueError(f"there is no live figure {name!r}; there are: {', '.join(names)}")
    for what, text in (("question", question), ("seen", seen), ("alt", alt)):
        if not text.strip():
            raise ValueError(f"{what} is empty; a sentence is needed")
    right = [answer.right for answer in answers]
    if len(right) not in (2, 3) or sum(right) != 1:
        raise ValueError(f"{sum(right)} of {len(right)} answers are right; one of two or three is needed")
    return live_page(
        "meshot_book/live/assets/panel",
        data,
        f"LiveFigure({name!r}; run the cell to try it)",
        script=f"meshot_book/live/figures/assets/{name}",
        alt=alt,
        still=still_of(still),
        question=question,
        answers=[dataclasses.asdict(answer) for answer in answers],
        seen=seen,
        hint=hint,
    )


def figure_names() -> list[str]:
    """The names of all live figures."""
    folder = resources.files("meshot_book") / "live" / "figures" / "assets"
    return sorted(file.name.removesuffix(".js") for file in folder.iterdir())
