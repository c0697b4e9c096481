from .ledger import (
    CONDITION as CONDITION,
)
from .ledger import (
    NOT_REPRODUCED as NOT_REPRODUCED,
)
from .ledger import (
    NOT_TESTABLE as NOT_TESTABLE,
)
from .ledger import (
    NOT_TESTED as NOT_TESTED,
)
from .ledger import (
    REPRODUCED as REPRODUCED,
)
from .ledger import (
    Verdict as Verdict,
)
from .ledger import (
    ledger_page as ledger_page,
)
