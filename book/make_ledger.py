"""Write ``book/ledger.md`` from the committed results (``make ledger``); a test compares the two."""

from pathlib import Path

from meshot.files import whole_file
from meshot.report import ledger
from meshot.report.judges import JUDGES

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "book" / "ledger.md"


def ledger_page() -> str:
    """The ledger as the committed results make it."""
    return ledger.ledger_page(ROOT / "book" / "claims.yaml", ROOT / "experiments", JUDGES)


if __name__ == "__main__":
    with whole_file(PAGE) as temporary:
        temporary.write_text(ledger_page(), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")
