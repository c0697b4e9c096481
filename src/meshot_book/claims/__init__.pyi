from .ledger import (
    CONDITION as CONDITION,
    NOT_REPRODUCED as NOT_REPRODUCED,
    NOT_TESTABLE as NOT_TESTABLE,
    NOT_TESTED as NOT_TESTED,
    REPRODUCED as REPRODUCED,
    Verdict as Verdict,
    ledger_page as ledger_page,
)
