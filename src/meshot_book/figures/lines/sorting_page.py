"""The page of sorting as transport: style, controls and script, with marks where the data go."""

from meshot.view import OPENING

PAGE = (
    """
<div id="@ID@" class="sorting" role="group" aria-label="@LABEL@">
<style>
.sorting { color-scheme: light; }
.sorting { max-width: 44rem; padding: .5rem; border-radius: 4px; background: #fff; color: #1a1a1a; }
.sorting [hidden] { display: none !important; }
.sorting img { max-width: 100%; background: #fff; }
.sorting svg { width: 100%; display: block; background: #fff; }
.sorting svg text { font: 24px sans-serif; fill: #1a1a1a; }
.sorting .grain { cursor: grab; }
.sorting .grain:focus { outline: none; }
.sorting .grain .ring { fill: transparent; stroke: none; }
.sorting .grain:focus .ring { stroke: #1a1a1a; stroke-width: 2; stroke-dasharray: 4 3; }
.sorting .controls { display: flex; gap: .35rem 1.1rem; align-items: center; margin-top: .3rem; flex-wrap: wrap; }
.sorting fieldset { border: 0; margin: 0; padding: 0; display: flex; gap: .6rem; flex-wrap: wrap; min-width: 0; }
.sorting legend { float: left; padding: .2rem 0; margin-right: .6rem; font-size: 1rem; width: auto; color: #1a1a1a; }
.sorting label, .sorting p { color: #1a1a1a; }
.sorting label { cursor: pointer; padding: .2rem 0; }
.sorting button { padding: .3rem .6rem; font: inherit; cursor: pointer; }
.sorting p { margin: .4rem 0; font-variant-numeric: tabular-nums; }
</style>
<img alt="@LABEL@" src="data:image/png;base64,@STILL@">
<svg viewBox="0 0 640 330" hidden></svg>
<p role="status" hidden></p>
<div class="controls" hidden>
<fieldset><legend>Exponent</legend>@EXPONENTS@</fieldset>
<fieldset><legend>Pairing</legend>
<label><input type="radio" name="@ID@-pairing" value="sorted" checked> sorted</label>
<label><input type="radio" name="@ID@-pairing" value="random"> random</label>
</fieldset>
<label><input type="checkbox" class="masses"> unequal masses</label>
<button type="button" class="again">another random pairing</button>
<button type="button" class="uncross">uncross one pair</button>
<button type="button" class="lighter">lighter</button>
<button type="button" class="heavier">heavier</button>
<button type="button" class="reset">reset</button>
</div>
</div>
<script>
"""
    + OPENING
    + """  @ARITHMETIC@
  @BEHAVIOUR@
})();
</script>
"""
)

BEHAVIOUR = """
  const SVG = "http://www.w3.org/2000/svg", svg = root.querySelector("svg"), status = root.querySelector("p");
  const [low, high] = data.range, margin = 34, width = 640, rows = { source: 88, target: 242 };
  const find = (name) => root.querySelector("." + name);
  const random = generator(7);
  const state = { exponent: data.exponent, pairing: "sorted", equal: true, plan: [], chosen: null };
  const at = (position) => margin + (position - low) / (high - low) * (width - 2 * margin);
  const make = (kind, attributes, parent) => {
    const node = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) { node.setAttribute(name, value); }
    parent.append(node);
    return node;
  };
  const sides = {};
  const normal = (values) => { const sum = values.reduce((s, v) => s + v, 0); return values.map((v) => v / sum); };
  const weights = (side) => normal(state.equal ? side.raw.map(() => 1) : side.raw);
  function ticks(y, below) {
    make("line", { x1: at(low), x2: at(high), y1: y, y2: y, stroke: "#1a1a1a" }, svg);
    for (let k = Math.ceil(low); k <= high; k += 1) {
      make("line", { x1: at(k), x2: at(k), y1: y, y2: y + (below ? 7 : -7), stroke: "#1a1a1a" }, svg);
      if (below && k % 2 === 0) {
        make("text", { x: at(k), y: y + 30, "text-anchor": "middle" }, svg).textContent = k;
      }
    }
  }
  ticks(rows.source, false);
  ticks(rows.target, true);
  make("text", { x: margin, y: 24 }, svg).textContent = "source";
  make("text", { x: margin, y: rows.target + 66 }, svg).textContent = "target";
  const title = make("text", { x: width / 2, y: rows.target + 66, "text-anchor": "middle" }, svg);
  title.textContent = "position on the line (units)";
  const lines = make("g", { "stroke-linecap": "round" }, svg);
  for (const name of ["source", "target"]) {
    const side = { positions: data[name].slice(), raw: data[name + "_masses"].slice(), grains: [] };
    side.positions.forEach((_, i) => side.grains.push(grain(name, side, i)));
    sides[name] = side;
  }
  function grain(name, side, i) {
    const node = make("g", { class: "grain", role: "slider", tabindex: 0, "aria-valuemin": low, "aria-valuemax": high,
      "aria-label": name + " grain " + (i + 1) }, svg);
    make("circle", { class: "ring", r: 24 }, node);
    make("circle", { class: "body", fill: name === "source" ? "#0072B2" : "#8C8C8C", stroke: "#fff" }, node);
    // The style touch-action does not reach SVG groups: without this a browser takes the finger for scrolling.
    node.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    node.addEventListener("focus", () => { state.chosen = [side, i]; });
    node.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      node.focus();
      node.setPointerCapture(event.pointerId);
    });
    node.addEventListener("pointermove", (event) => {
      if (!node.hasPointerCapture(event.pointerId)) { return; }
      const box = svg.getBoundingClientRect(), place = (event.clientX - box.left) / box.width * width;
      move(side, i, low + (place - margin) / (width - 2 * margin) * (high - low));
    });
    node.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 1 : 0.1, now = side.positions[i];
      const to = { ArrowLeft: now - step, ArrowRight: now + step, Home: low, End: high }[event.key];
      if (to !== undefined) { event.preventDefault(); move(side, i, to); }
      const factor = { ArrowUp: 1.25, ArrowDown: 0.8, "+": 1.25, "-": 0.8 }[event.key];
      if (factor) { event.preventDefault(); weigh(side, i, factor); }
    });
    return node;
  }
  function move(side, i, place) {
    side.positions[i] = Math.min(high, Math.max(low, Math.round(place * 100) / 100));
    draw();
  }
  function weigh(side, i, factor) {
    side.raw[i] = Math.min(10, Math.max(0.1, side.raw[i] * factor));
    state.equal = false;
    find("masses").checked = true;
    pair();
  }
  function pair() {
    const a = weights(sides.source), b = weights(sides.target);
    if (state.pairing === "random") {
      state.plan = couple(shuffled(a.length, random), a, shuffled(b.length, random), b);
    }
    draw();
  }
  function draw() {
    const x = sides.source.positions, y = sides.target.positions;
    const a = weights(sides.source), b = weights(sides.target), best = sorted(x, a, y, b);
    const plan = state.pairing === "sorted" ? best : state.plan, p = state.exponent;
    lines.replaceChildren();
    for (const one of plan) {
      const crossed = plan.some((other) => crosses(one, other, x, y));
      make("line", { x1: at(x[one[0]]), y1: rows.source, x2: at(y[one[1]]), y2: rows.target, "stroke-opacity": 0.7,
        stroke: crossed ? "#D55E00" : "#0072B2", "stroke-dasharray": crossed ? "9 7" : "none",
        "stroke-width": Math.max(1.2, 36 * one[2]) }, lines);
    }
    for (const [name, masses] of [["source", a], ["target", b]]) {
      sides[name].grains.forEach((node, i) => {
        const place = sides[name].positions[i];
        node.setAttribute("transform", "translate(" + at(place) + " " + rows[name] + ")");
        node.setAttribute("aria-valuenow", place);
        node.setAttribute("aria-valuetext", "at " + place.toFixed(2) + ", mass " + masses[i].toFixed(3));
        node.querySelector(".body").setAttribute("r", (36 * Math.sqrt(masses[i])).toFixed(2));
      });
    }
    say(plan, best, x, y, p);
  }
  function say(plan, best, x, y, p) {
    const shown = cost(plan, x, y, p), least = cost(best, x, y, p), count = crossings(plan, x, y);
    root.dataset.cost = shown;
    root.dataset.least = least;
    root.dataset.crossings = count;
    const digits = (value) => Number(value.toPrecision(4)).toString();
    status.textContent = state.pairing === "sorted"
      ? "Sorted pairing, p = " + p + ": mean cost " + digits(least) + ", the least there is. No crossings."
      : "This pairing, p = " + p + ": mean cost " + digits(shown) + ", " + count
        + (count === 1 ? " crossing. " : " crossings. ") + "Sorted: " + digits(least) + ".";
    find("uncross").disabled = state.pairing === "sorted" || count === 0;
    find("again").disabled = state.pairing === "sorted";
  }
  function start() {
    for (const name of ["source", "target"]) {
      sides[name].positions = data[name].slice();
      sides[name].raw = data[name + "_masses"].slice();
    }
    pair();
  }
  root.querySelectorAll("input[type=radio]").forEach((input) => input.addEventListener("change", () => {
    if (input.name.endsWith("exponent")) { state.exponent = Number(input.value); draw(); return; }
    state.pairing = input.value;
    pair();
  }));
  find("masses").addEventListener("change", (event) => { state.equal = !event.target.checked; pair(); });
  find("again").addEventListener("click", pair);
  find("uncross").addEventListener("click", () => {
    state.plan = uncrossed(state.plan, sides.source.positions, sides.target.positions);
    draw();
  });
  for (const [name, factor] of [["lighter", 0.8], ["heavier", 1.25]]) {
    find(name).addEventListener("click", () => weigh(...(state.chosen || [sides.source, 0]), factor));
  }
  find("reset").addEventListener("click", start);
  root.querySelector("img").hidden = true;
  // SVG elements have no `hidden` property of their own in every browser.
  svg.removeAttribute("hidden");
  status.hidden = false;
  find("controls").hidden = false;
  start();
"""
