"""Write ``book/ledger.md`` and the checksums of the experiments' files from the committed results (``make ledger``).

Tests compare both with the results.
"""

from pathlib import Path

from meshot.files import write_whole
from meshot_book.claims import ledger_page as page_of_claims
from meshot_book.claims.rules import RULES
from meshot_book.notebook import CHECKSUMS, checksum_lines

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "book" / "ledger.md"


def ledger_page() -> str:
    """The ledger as the committed results make it."""
    return page_of_claims(ROOT / "book" / "claims.yaml", ROOT / "experiments", RULES)


if __name__ == "__main__":
    for path, text in ((PAGE, ledger_page()), (CHECKSUMS, checksum_lines(ROOT / "experiments"))):
        write_whole(path, text)
        print(f"wrote {path.relative_to(ROOT)}")
