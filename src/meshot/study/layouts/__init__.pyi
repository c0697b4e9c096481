from .chosen import LAYOUTS as LAYOUTS, Layout as Layout, layout_named as layout_named
