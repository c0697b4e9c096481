"""Write ``book/ledger.md`` from the committed results (``make ledger``); a test compares the two."""

from pathlib import Path

from meshot.files import whole_file
from meshot_book.claims import ledger_page as page_of_claims
from meshot_book.claims.rules import RULES

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "book" / "ledger.md"


def ledger_page() -> str:
    """The ledger as the committed results make it."""
    return page_of_claims(ROOT / "book" / "claims.yaml", ROOT / "experiments", RULES)


if __name__ == "__main__":
    with whole_file(PAGE) as temporary:
        temporary.write_text(ledger_page(), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")
