from .plan import MonotonePlan as MonotonePlan
from .plan import monotone_plan as monotone_plan
from .projection import ProjectedLaw as ProjectedLaw
from .projection import projected_law as projected_law
