from .engine import (
    SCHEDULES as SCHEDULES,
    Plan as Plan,
    Progress as Progress,
    Task as Task,
    Training as Training,
    TrainingLog as TrainingLog,
    TrainingSettings as TrainingSettings,
    chosen_device as chosen_device,
    data_record as data_record,
    examples_of_step as examples_of_step,
    read_log as read_log,
    require_examples as require_examples,
    train as train,
    train_network as train_network,
)
from .state import TrainingState as TrainingState
