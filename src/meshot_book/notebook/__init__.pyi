from .environment import KERNEL_ENVIRONMENT as KERNEL_ENVIRONMENT, environment_card as environment_card
from .numbers import digits as digits
from .tables import Table as Table, markdown_table as markdown_table, table as table
