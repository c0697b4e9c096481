from .engine import (
    Plan as Plan,
    Progress as Progress,
    Task as Task,
    Training as Training,
    TrainingLog as TrainingLog,
    chosen_device as chosen_device,
    data_record as data_record,
    examples_of_step as examples_of_step,
    plan_of_epochs as plan_of_epochs,
    read_log as read_log,
    require_examples as require_examples,
    require_plan_settings as require_plan_settings,
    train as train,
    train_network as train_network,
)
from .state import (
    TrainingState as TrainingState,
)
