from .given import drawn_curves as drawn_curves
from .reports import read_report as read_report, report as report
from .verdict import Record as Record
