from .environment import KERNEL_ENVIRONMENT as KERNEL_ENVIRONMENT
from .environment import environment_card as environment_card
from .numbers import digits as digits
from .numbers import markdown_table as markdown_table
from .numbers import table as table
