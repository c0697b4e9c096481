"""Punctuation of a page that stands on another line than the formula, or the word of code, that it touches."""

from playwright.sync_api import Page

#: A mark before a box has to end where the box begins or earlier, a mark after it to begin where the box ends or later:
#: on another line it would not. What is folded has no place.
STRANDED = r"""() => {
  const found = [];
  const neighbour = (node, side) => {
    while (node && !node[side] && ['span', 'em', 'strong', 'a'].includes(node.parentElement.localName)) {
      node = node.parentElement;
    }
    return node[side]?.nodeType === Node.TEXT_NODE ? node[side] : null;
  };
  const look = (box, text, at, lost) => {
    const range = document.createRange();
    range.setStart(text, at);
    range.setEnd(text, at + 1);
    const place = range.getBoundingClientRect();
    if (place.width && lost(place)) found.push(`${box.textContent.slice(0, 30)} and ${text.data.trim().slice(0, 20)}`);
  };
  for (const box of document.querySelectorAll('article span.math, article :not(pre) > code')) {
    const rects = [...box.getClientRects()];
    if (!rects.length || (box.localName === 'code' && box.textContent.length > 24)) continue;
    const [before, after] = [neighbour(box, 'previousSibling'), neighbour(box, 'nextSibling')];
    if (after && /^[.,;:!?)\]”’]/.test(after.data)) look(box, after, 0, (p) => p.left < rects.at(-1).right - 2);
    if (before && /[(\[“]$/.test(before.data)) look(box, before, before.length - 1, (p) => p.right > rects[0].left + 2);
  }
  return found;
}"""


def stranded(page: Page) -> list[str]:
    """What stands apart, at the width that the window has."""
    return page.evaluate(STRANDED)
