from .configuration import (
    Groups as Groups,
)
from .configuration import (
    changed_groups as changed_groups,
)
from .configuration import (
    checked_groups as checked_groups,
)
from .configuration import (
    read_groups as read_groups,
)
from .configuration import (
    setting_names as setting_names,
)
from .engine import Progress as Progress
from .engine import Task as Task
from .engine import Training as Training
from .engine import chosen_device as chosen_device
from .engine import train as train
from .engine import train_network as train_network
from .log import TrainingLog as TrainingLog
from .log import read_log as read_log
from .plan import Plan as Plan
from .plan import require_plan_settings as require_plan_settings
from .state import TrainingState as TrainingState
