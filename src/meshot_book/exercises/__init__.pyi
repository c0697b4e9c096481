from .measures import drawn_curves as drawn_curves
