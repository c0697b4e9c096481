from .checkpoint import TrainingLog as TrainingLog, TrainingState as TrainingState, read_log as read_log
from .configuration import (
    Groups as Groups,
    changed_groups as changed_groups,
    checked_groups as checked_groups,
    read_groups as read_groups,
    setting_names as setting_names,
)
from .engine import (
    Plan as Plan,
    Progress as Progress,
    Training as Training,
    chosen_device as chosen_device,
    require_plan_settings as require_plan_settings,
    train as train,
)
