"""The page of an interactive view: style, controls and a small WebGL 2 viewer, with marks where the data go.

Why no library: at 20 480 faces pyvista's export (vtk.js) takes 1.5 MB a scene and twenty more packages, this page and
its data .15 MB and none; it needs no file beside it, so the same output serves JupyterLab and the book from file://.
"""

STYLE = """
.surface-scene { max-width: 44rem; margin: 0 0 1rem; color: inherit; }
.surface-scene [hidden] { display: none !important; }
.surface-scene .stage { position: relative; aspect-ratio: 4 / 3; }
.surface-scene .stage > * { position: absolute; inset: 0; width: 100%; height: 100%; }
.surface-scene .start { padding: 0; border: 0; background: none; color: inherit; font: inherit; cursor: pointer; }
.surface-scene .start:focus-visible, .surface-scene canvas:focus-visible {
  outline: 3px solid #0072B2; outline-offset: -3px; }
.surface-scene img { width: 100%; height: 100%; object-fit: contain; margin: 0; background: none !important; }
.surface-scene .hint { position: absolute; left: 50%; bottom: .5rem; transform: translateX(-50%); width: max-content;
  max-width: 95%; padding: .2rem .7rem; border-radius: 1rem; background: #222c; color: #fff; font-size: .85rem; }
.surface-scene canvas { touch-action: none; cursor: grab; display: block; }
.surface-scene .names { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; border: 0; margin: 0; padding: .2rem 0; }
.surface-scene .bar { max-width: 30rem; margin: .4rem auto; font-size: .9rem; text-align: center; }
.surface-scene .ramp { height: .8rem; border: 1px solid currentColor; }
.surface-scene .ticks { position: relative; height: 1.4rem; margin: 0; font-variant-numeric: tabular-nums; }
.surface-scene .ticks span { position: absolute; transform: translateX(-50%); white-space: nowrap; }
.surface-scene .help { font-size: .85rem; margin: .2rem 0; text-align: center; }
.surface-scene .back { font: inherit; cursor: pointer; }
.surface-scene figcaption { text-align: center; font-size: 1rem; font-weight: 400 !important;
  color: inherit !important; }
html[data-theme="dark"] .bd-content div.cell_output .text_html:has(> .surface-scene):not(:has(table.dataframe)) {
  background: none; color: inherit; }
"""

PAGE = """
<figure id="@ID@" class="surface-scene" role="group" aria-label="@ALT@" data-lm-suppress-shortcuts="true">
<style>@STYLE@</style>
<figcaption>@TITLE@</figcaption>
<div class="stage">
<button type="button" class="start"><img class="dark-light" alt="@ALT@" src="data:image/webp;base64,@STILL@"
><span class="hint">run the cell to turn it</span></button>
</div>
<fieldset class="names" hidden></fieldset>
@BAR@
<p class="help" hidden>drag or arrow keys: turn; wheel, pinch or + and −: zoom; 0: as before; Esc:
<button type="button" class="back">back to the still</button></p>
</figure>
<script>
@SCRIPT@
</script>
"""

BAR = """<div class="bar" role="img" aria-label="@BAR_LABEL@, from @LOW@ to @HIGH@">
<div class="ramp" style="background: linear-gradient(to right, @COLOURS@)"></div>
<div class="ticks">@TICKS@</div>
<div>@BAR_LABEL@</div>
</div>"""
