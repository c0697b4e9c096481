from .environment import (
    KERNEL_ENVIRONMENT as KERNEL_ENVIRONMENT,
    environment_card as environment_card,
    stated_seconds as stated_seconds,
)
from .experiment_files import (
    CHECKSUMS as CHECKSUMS,
    checksum_lines as checksum_lines,
    experiment_folder as experiment_folder,
)
from .mesh_files import (
    read_meshes as read_meshes,
    read_vertex_values as read_vertex_values,
    write_meshes as write_meshes,
)
from .tables import Table as Table, digits as digits, markdown_table as markdown_table, table as table
