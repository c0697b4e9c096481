from .plan import MonotonePlan as MonotonePlan, monotone_plan as monotone_plan
from .projection import ProjectedLaw as ProjectedLaw, projected_law as projected_law
