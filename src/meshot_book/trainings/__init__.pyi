from .processes import (
    OUTPUT as OUTPUT,
    Busy as Busy,
    alone as alone,
    curve as curve,
    require_device as require_device,
    steps_done as steps_done,
    thinned as thinned,
    train_in_processes as train_in_processes,
    train_in_turn as train_in_turn,
)
