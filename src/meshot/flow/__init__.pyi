from .integration import (
    METHODS as METHODS,
    flow_meshes as flow_meshes,
    integrate as integrate,
    trajectory as trajectory,
)
