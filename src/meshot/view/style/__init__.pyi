from .colours import (
    BLACK as BLACK,
)
from .colours import (
    BLUE as BLUE,
)
from .colours import (
    GREEN as GREEN,
)
from .colours import (
    GREY as GREY,
)
from .colours import (
    LOSS_COLOURS as LOSS_COLOURS,
)
from .colours import (
    LOSS_DASHES as LOSS_DASHES,
)
from .colours import (
    ORANGE as ORANGE,
)
from .colours import (
    PURPLE as PURPLE,
)
from .colours import (
    SKY as SKY,
)
from .colours import (
    TARGET as TARGET,
)
from .colours import (
    VERMILLION as VERMILLION,
)
from .colours import (
    WIDTH as WIDTH,
)
from .colours import (
    legend_above as legend_above,
)
from .colours import (
    loss_line as loss_line,
)
from .colours import (
    use_style as use_style,
)
