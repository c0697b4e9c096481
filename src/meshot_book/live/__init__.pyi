from .figure import Answer as Answer, live_figure as live_figure
