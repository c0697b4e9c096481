"""The page of the crossing triangles: style, controls and script, with marks where the data go."""

from meshot.view import OPENING

PAGE = (
    """
<div id="@ID@" class="crossing-player" role="group" aria-label="@LABEL@">
<style>
.crossing-player { color-scheme: light; max-width: 40rem; padding: .5rem; border-radius: 4px; background: #fff;
  color: #1a1a1a; }
.crossing-player [hidden] { display: none !important; }
.crossing-player canvas { width: 100%; max-width: 30rem; display: block; margin: 0 auto; }
.crossing-player img { max-width: 100%; background: #fff; }
.crossing-player .controls { display: grid; grid-template-columns: max-content 1fr 4.5rem; gap: .35rem .75rem;
  align-items: center; margin-top: .35rem; }
.crossing-player label, .crossing-player legend, .crossing-player output, .crossing-player p { color: #1a1a1a; }
.crossing-player .choice { grid-column: 1 / -1; display: flex; gap: 1rem; flex-wrap: wrap; border: 0; padding: 0;
  margin: 0; }
.crossing-player legend { font-size: inherit; margin: 0; padding: 0; }
.crossing-player input[type=range] { width: 100%; min-width: 5rem; }
.crossing-player output { font-variant-numeric: tabular-nums; }
.crossing-player .verdict { margin: .5rem 0 0; min-height: 3.2em; }
.crossing-player .verdict strong { color: #1a1a1a; }
@media (max-width: 30rem) { .crossing-player .controls { grid-template-columns: 1fr 4.5rem; }
  .crossing-player .controls label.name { grid-column: 1 / -1; } }
</style>
<img alt="@LABEL@" src="data:image/png;base64,@STILL@">
<canvas hidden width="800" height="860" role="img" aria-label="two triangles under the flow"></canvas>
<div class="controls" hidden>
<fieldset class="choice"><legend>What moves the points</legend>
<label><input type="radio" name="@ID@-field" value="push" checked> a push down the middle</label>
<label><input type="radio" name="@ID@-field" value="whirl"> a whirl about the middle</label></fieldset>
<label class="name" for="@ID@-time">time</label>
<input id="@ID@-time" class="time" type="range" min="0" max="1" step="0.01" value="0.6"><output></output>
<label class="name" for="@ID@-steps">Euler steps</label>
<input id="@ID@-steps" class="steps" type="range" min="1" max="64" step="1" value="8"><output></output>
<label class="name" for="@ID@-pieces">pieces of each side</label>
<input id="@ID@-pieces" class="pieces" type="range" min="0" max="5" step="1" value="0"><output></output>
</div>
<p class="verdict" aria-live="polite" hidden></p>
</div>
<script>
"""
    + OPENING
    + """  const canvas = root.querySelector("canvas"), pen = canvas.getContext("2d");
  const verdict = root.querySelector(".verdict");
  const slider = (name) => root.querySelector("input." + name);
  const says = (name) => slider(name).nextElementSibling;
  const left = -1.6, right = 1.6, bottom = -2.04, top = 1.4;
  const across = (x) => (x - left) / (right - left) * canvas.width;
  const down = (y) => (top - y) / (top - bottom) * canvas.height;
  const velocities = {
    push: (f, x, y) => [0, f.strength * Math.exp(-x * x / (2 * f.reach * f.reach))],
    whirl: (f, x, y) => {
      const turn = f.strength * Math.exp(-(x * x + y * y) / (2 * f.reach * f.reach));
      return [-turn * y, turn * x];
    }
  };
  const moved = (state, points) => points.map(([x, y]) => {
    const h = state.time / state.steps;
    for (let k = 0; k < state.steps; k++) {
      const [a, b] = state.velocity(x, y);
      x += h * a;
      y += h * b;
    }
    return [x, y];
  });
  const cut = (corners, pieces) => corners.flatMap((a, i) => {
    const b = corners[(i + 1) % 3];
    return Array.from({ length: pieces }, (_, k) => [0, 1].map((c) => a[c] + k / pieces * (b[c] - a[c])));
  });
  const side = (a, b, c) => Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
  const cross = (a, b, c, d) => side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
  function pairs(shapes) {
    const sides = shapes.flatMap((shape) => shape.map((a, i) => [a, shape[(i + 1) % shape.length]]));
    let found = 0;
    for (let i = 0; i < sides.length; i++) {
      for (let j = 0; j < i; j++) { found += cross(...sides[i], ...sides[j]); }
    }
    return found;
  }
  function line(points, closed) {
    pen.beginPath();
    points.forEach(([x, y], i) => i ? pen.lineTo(across(x), down(y)) : pen.moveTo(across(x), down(y)));
    if (closed) { pen.closePath(); }
  }
  function draw() {
    const name = root.querySelector("input[type=radio]:checked").value, field = data.fields[name];
    const state = { time: Number(slider("time").value), steps: Number(slider("steps").value) };
    state.velocity = (x, y) => velocities[name](field, x, y);
    const pieces = 2 ** Number(slider("pieces").value);
    says("time").textContent = state.time.toFixed(2);
    says("steps").textContent = state.steps;
    says("pieces").textContent = pieces;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineWidth = 1;
    pen.strokeStyle = "#bbbbbb";
    for (let k = -8; k <= 8; k++) {
      const fine = Array.from({ length: 161 }, (_, i) => -2 + i / 40);
      line(moved(state, fine.map((s) => [k / 4, s])), false);
      pen.stroke();
      line(moved(state, fine.map((s) => [s, k / 4])), false);
      pen.stroke();
    }
    const shapes = data.corners.map((corners) => moved(state, cut(corners, pieces)));
    data.corners.forEach((corners, i) => {
      line(shapes[i], true);
      pen.fillStyle = data.colours[i] + "59";
      pen.fill();
      pen.strokeStyle = data.colours[i];
      pen.lineWidth = 4;
      pen.setLineDash([]);
      pen.stroke();
      line(moved(state, cut(corners, 64)), true);
      pen.strokeStyle = "#404040";
      pen.lineWidth = 2;
      pen.setLineDash([3, 6]);
      pen.stroke();
      pen.setLineDash([]);
      pen.fillStyle = "#1a1a1a";
      for (const [x, y] of shapes[i]) {
        pen.beginPath();
        pen.arc(across(x), down(y), pieces > 4 ? 3 : 6, 0, 2 * Math.PI);
        pen.fill();
      }
    });
    const found = pairs(shapes), bound = state.time / state.steps * field.lipschitz;
    root.dataset.pairs = found;
    root.dataset.bound = bound;
    const points = bound < 1 ? "below 1: no two points of the plane meet" : "not below 1: points may meet";
    const many = found === 1 ? "One pair" : found + " pairs";
    const sides = found ? many + " of straight sides cross." : "No sides cross.";
    const start = "Step times Lipschitz constant: " + bound.toFixed(3) + ", " + points;
    verdict.innerHTML = start + ". <strong>" + sides + "</strong>";
  }
  root.querySelectorAll("input").forEach((input) => input.addEventListener("input", draw));
  root.querySelector("img").hidden = true;
  for (const part of [canvas, root.querySelector(".controls"), verdict]) { part.hidden = false; }
  draw();
})();
</script>
"""
)
