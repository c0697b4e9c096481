from .configuration import (
    Groups as Groups,
    changed_groups as changed_groups,
    checked_groups as checked_groups,
    read_groups as read_groups,
    setting_names as setting_names,
)
from .engine import (
    Progress as Progress,
    Task as Task,
    Training as Training,
    chosen_device as chosen_device,
    train as train,
    train_network as train_network,
)
from .examples import (
    data_record as data_record,
    examples_of_step as examples_of_step,
    require_examples as require_examples,
)
from .log import TrainingLog as TrainingLog, read_log as read_log
from .plan import Plan as Plan, plan_of_epochs as plan_of_epochs, require_plan_settings as require_plan_settings
from .state import TrainingState as TrainingState
