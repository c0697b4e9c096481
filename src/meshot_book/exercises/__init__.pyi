from .given import drawn_curves as drawn_curves
from .reports import report as report
