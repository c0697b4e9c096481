from .ledger import (
    ASSUMING as ASSUMING,
    AT_THIS_BUDGET as AT_THIS_BUDGET,
    CHOICE as CHOICE,
    IN_PART as IN_PART,
    NOT_REPRODUCED as NOT_REPRODUCED,
    NOT_TESTABLE as NOT_TESTABLE,
    NOT_TESTED as NOT_TESTED,
    PROVED as PROVED,
    REPRODUCED as REPRODUCED,
    Entry as Entry,
    Verdict as Verdict,
    fill as fill,
    ledger_page as ledger_page,
    read_entries as read_entries,
)
from .rules.systems import own_loss_points as own_loss_points
