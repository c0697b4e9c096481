from .environment import KERNEL_ENVIRONMENT as KERNEL_ENVIRONMENT, environment_card as environment_card
from .numbers import digits as digits, markdown_table as markdown_table, table as table
