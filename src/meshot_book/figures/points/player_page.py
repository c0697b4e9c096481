"""The page of the player: style, controls and script, with marks where the data go."""

from meshot.view import OPENING

PAGE = (
    """
<div id="@ID@" class="point-player" role="group" aria-label="@LABEL@">
<style>
.point-player { max-width: 44rem; padding: .5rem; border-radius: 4px; background: #fff; color: #1a1a1a; }
.point-player [hidden] { display: none !important; }
.point-player .panels { display: flex; gap: .5rem; }
.point-player figure { flex: 1; margin: 0; min-width: 0; }
.point-player figcaption, .point-player output { color: #1a1a1a; }
.point-player figcaption { font-size: .95rem; text-align: center; }
.point-player canvas { width: 100%; display: block; }
.point-player img { max-width: 100%; background: #fff; }
.point-player .controls { display: flex; gap: .75rem; align-items: center; margin-top: .25rem; flex-wrap: wrap; }
.point-player button { min-width: 5rem; padding: .3rem .6rem; font: inherit; cursor: pointer; }
.point-player input { flex: 1; min-width: 8rem; }
.point-player output { min-width: 6.5rem; font-variant-numeric: tabular-nums; }
</style>
<img alt="@LABEL@" src="data:image/png;base64,@STILL@">
<div class="panels" hidden></div>
<div class="controls" hidden>
<button type="button" aria-label="play or pause">&#9654; play</button>
<input type="range" min="0" max="@LAST@" step="1" value="@LAST@" aria-label="moment of the descent">
<output></output>
</div>
</div>
<script>
"""
    + OPENING
    + """  const [left, right, bottom, top] = data.box;
  const button = root.querySelector("button"), slider = root.querySelector("input");
  const output = root.querySelector("output"), holder = root.querySelector(".panels");
  const last = data.steps.length - 1;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const unpack = (text) => new Uint16Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const panels = data.panels.map((panel) => {
    const figure = document.createElement("figure"), canvas = document.createElement("canvas");
    const caption = document.createElement("figcaption");
    caption.textContent = panel.name;
    canvas.width = 720;
    canvas.height = Math.round(720 * (top - bottom) / (right - left));
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", panel.name + ": points on their way to the polygon");
    figure.append(caption, canvas);
    holder.append(figure);
    const points = unpack(panel.points);
    return { canvas, colour: panel.colour, points, size: points.length / data.steps.length };
  });
  function draw(moment) {
    const before = Math.min(Math.floor(moment), last), after = Math.min(before + 1, last), part = moment - before;
    for (const panel of panels) {
      const pen = panel.canvas.getContext("2d"), width = panel.canvas.width, height = panel.canvas.height;
      pen.clearRect(0, 0, width, height);
      pen.strokeStyle = "#8c8c8c99";
      pen.lineWidth = 7;
      pen.lineCap = "round";
      pen.beginPath();
      for (const [start, end] of data.edges) {
        pen.moveTo((start[0] - left) / (right - left) * width, (top - start[1]) / (top - bottom) * height);
        pen.lineTo((end[0] - left) / (right - left) * width, (top - end[1]) / (top - bottom) * height);
      }
      pen.stroke();
      pen.fillStyle = panel.colour;
      for (let i = 0; i < panel.size; i += 2) {
        const a = before * panel.size + i, b = after * panel.size + i;
        const x = panel.points[a] + part * (panel.points[b] - panel.points[a]);
        const y = panel.points[a + 1] + part * (panel.points[b + 1] - panel.points[a + 1]);
        pen.beginPath();
        pen.arc(x / 65535 * width, (1 - y / 65535) * height, 4.5, 0, 2 * Math.PI);
        pen.fill();
      }
    }
    const step = Math.round(data.steps[before] + part * (data.steps[after] - data.steps[before]));
    output.textContent = "step " + step;
    slider.setAttribute("aria-valuetext", "step " + step);
  }
  let playing = false, begun = 0, from = 0;
  function show(now) {
    if (!playing || !root.isConnected) { return; }
    const gone = from + (now - begun) / 1000 * (calm ? 2 : 5);
    const moment = Math.min(calm ? Math.floor(gone) : gone, last);
    slider.value = moment;
    draw(moment);
    if (moment >= last) { stop(); } else { requestAnimationFrame(show); }
  }
  function stop() { playing = false; button.textContent = "\\u25b6 play"; }
  button.addEventListener("click", () => {
    if (playing) { stop(); return; }
    playing = true;
    button.textContent = "\\u275a\\u275a pause";
    from = Number(slider.value) >= last ? 0 : Number(slider.value);
    begun = performance.now();
    requestAnimationFrame(show);
  });
  slider.addEventListener("input", () => { stop(); draw(Number(slider.value)); });
  root.querySelector("img").hidden = true;
  holder.hidden = false;
  root.querySelector(".controls").hidden = false;
  draw(last);
})();
</script>
"""
)
