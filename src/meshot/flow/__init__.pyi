from .integration import (
    METHODS as METHODS,
)
from .integration import (
    flow_meshes as flow_meshes,
)
from .integration import (
    integrate as integrate,
)
from .integration import (
    trajectory as trajectory,
)
