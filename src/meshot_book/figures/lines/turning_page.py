"""The page of the turning line: style, controls and script, with marks where the data go."""

from meshot.view import OPENING

PAGE = (
    """
<div id="@ID@" class="turning" role="group" aria-label="@LABEL@">
<style>
.turning { max-width: 44rem; padding: .5rem; border-radius: 4px; background: #fff; color: #1a1a1a; }
.turning [hidden] { display: none !important; }
.turning img { max-width: 100%; background: #fff; }
.turning svg { width: 100%; display: block; background: #fff; }
.turning svg text { font: 20px sans-serif; fill: #1a1a1a; stroke: #fff; stroke-width: 4px; paint-order: stroke; }
.turning .plane { cursor: grab; touch-action: none; }
.turning .controls { display: flex; gap: .5rem .75rem; align-items: center; margin-top: .3rem; flex-wrap: wrap; }
.turning button { padding: .3rem .6rem; font: inherit; cursor: pointer; }
.turning input { flex: 1; min-width: 8rem; }
.turning label, .turning p { color: #1a1a1a; }
.turning p { margin: .4rem 0; font-variant-numeric: tabular-nums; }
</style>
<img alt="@LABEL@" src="data:image/png;base64,@STILL@">
<svg viewBox="0 0 700 400" hidden></svg>
<p role="status" hidden></p>
<div class="controls" hidden>
<input type="range" min="0" max="179" step="1" value="@ANGLE@" aria-label="angle of the line in degrees">
<button type="button" class="turn">turn</button>
<button type="button" class="one">one random line</button>
<button type="button" class="ten">ten more</button>
<button type="button" class="clear">clear</button>
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

ARITHMETIC = """
  const project = (points, degrees) => {
    const c = Math.cos(degrees * Math.PI / 180), s = Math.sin(degrees * Math.PI / 180);
    return points.map(([x, y]) => c * x + s * y);
  };
  const sortedOrder = (values) => values.map((_, i) => i).sort((i, j) => values[i] - values[j]);
  const pairsAt = (source, target, degrees) => {
    const x = project(source, degrees), y = project(target, degrees), ranks = sortedOrder(y);
    return sortedOrder(x).map((i, rank) => [x[i], y[ranks[rank]]]);
  };
  const costAt = (source, target, degrees) => {
    const pairs = pairsAt(source, target, degrees);
    return pairs.reduce((sum, [x, y]) => sum + (x - y) * (x - y), 0) / pairs.length;
  };
  const average = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const standardError = (values) => {
    const middle = average(values), n = values.length;
    return Math.sqrt(values.reduce((sum, value) => sum + (value - middle) ** 2, 0) / (n - 1) / n);
  };
  const generator = (seed) => () => {
    seed = (seed + 0x6D2B79F5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
"""

BEHAVIOUR = """
  const SVG = "http://www.w3.org/2000/svg", svg = root.querySelector("svg"), status = root.querySelector("p");
  const slider = root.querySelector("input"), find = (name) => root.querySelector("." + name);
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const colours = { source: "#0072B2", target: "#E69F00" }, names = ["source", "target"];
  const radius = Math.max(...names.flatMap((name) => data[name].map(([x, y]) => Math.hypot(x, y))));
  const middle = [175, 175], unit = 92 / radius, random = generator(1);
  const costs = Array.from({ length: 180 }, (_, degrees) => costAt(data.source, data.target, degrees));
  const mean = average(costs), highest = 1.08 * Math.max(...costs);
  let drawn = [], playing = false;
  const make = (kind, attributes, parent) => {
    const node = document.createElementNS(SVG, kind);
    for (const [key, value] of Object.entries(attributes)) { node.setAttribute(key, value); }
    (parent || svg).append(node);
    return node;
  };
  const write = (text, x, y, more) => { make("text", { x, y, ...more }).textContent = text; };
  const dot = (name, x, y, size, parent) => name === "source"
    ? make("circle", { cx: x, cy: y, r: size, fill: colours.source }, parent)
    : make("rect", { x: x - size, y: y - size, width: 2 * size, height: 2 * size, fill: colours.target }, parent);
  const plane = make("g", { class: "plane" });
  make("rect", { x: 0, y: 0, width: 350, height: 400, fill: "#fff" }, plane);
  const moving = make("g", {}, plane);
  for (const name of names) {
    for (const [x, y] of data[name]) { dot(name, middle[0] + unit * x, middle[1] - unit * y, 4.5, plane); }
  }
  dot("source", 14, 388, 5); write("source", 26, 394);
  dot("target", 104, 388, 5); write("target", 116, 394);
  const box = { left: 430, right: 675, top: 40, bottom: 310 };
  const across = (degrees) => box.left + degrees / 180 * (box.right - box.left);
  const up = (cost) => box.bottom - cost / highest * (box.bottom - box.top);
  make("path", { d: `M${box.left} ${box.top}V${box.bottom}H${box.right}`, fill: "none", stroke: "#1a1a1a" });
  const centred = { "text-anchor": "middle" }, flush = { "text-anchor": "end" };
  for (const degrees of [0, 90, 180]) {
    write(degrees, across(degrees), box.bottom + 22, centred);
  }
  write("angle of the line (degrees)", (box.left + box.right) / 2, box.bottom + 50, centred);
  write("cost on the line", box.left - 30, 24);
  for (const cost of [0, mean]) { write(cost.toPrecision(2) * 1, box.left - 8, up(cost) + 6, flush); }
  const dashes = { stroke: "#8c8c8c", "stroke-width": 2, "stroke-dasharray": "7 5" };
  make("path", { d: `M${box.left} ${up(mean)}H${box.right}`, ...dashes });
  const path = [...costs, costs[0]].map((cost, degrees) => `${across(degrees).toFixed(1)} ${up(cost).toFixed(1)}`);
  make("path", { d: "M" + path.join("L"), fill: "none", stroke: "#1a1a1a", "stroke-width": 2.5 });
  write("mean", box.right, up(mean) - 7, flush);
  const samples = make("g", {}), marker = make("circle", { r: 7, fill: "#D55E00", stroke: "#fff" });

  function draw(degrees) {
    const angle = degrees * Math.PI / 180, along = [Math.cos(angle), -Math.sin(angle)];
    const away = [Math.sin(angle), Math.cos(angle)], feet = {};
    moving.replaceChildren();
    const place = (name, value) => {
      const shift = data.rows[names.indexOf(name)] * radius;
      return [0, 1].map((k) => middle[k] + unit * (value * along[k] + shift * away[k]));
    };
    const line = (from, to, attributes) =>
      make("line", { x1: from[0], y1: from[1], x2: to[0], y2: to[1], ...attributes }, moving);
    for (const name of names) {
      line(place(name, -1.1 * radius), place(name, 1.1 * radius), { stroke: "#8c8c8c" });
      project(data[name], degrees).forEach((value, i) => {
        const [x, y] = data[name][i], start = [middle[0] + unit * x, middle[1] - unit * y];
        line(start, place(name, value), { stroke: colours[name], opacity: 0.35 });
      });
    }
    for (const [x, y] of pairsAt(data.source, data.target, degrees)) {
      line(place("source", x), place("target", y), { stroke: "#1a1a1a", "stroke-width": 1.5 });
      dot("source", ...place("source", x), 3, moving);
      dot("target", ...place("target", y), 3, moving);
    }
    const cost = costAt(data.source, data.target, degrees);
    marker.setAttribute("cx", across(degrees));
    marker.setAttribute("cy", up(cost));
    Object.assign(root.dataset, { angle: degrees, cost, mean, drawn: drawn.length });
    tell(degrees, cost);
  }
  function tell(degrees, cost) {
    let text = `Angle ${Math.round(degrees)}\\u00b0: cost ${cost.toPrecision(3)}. Mean over all angles: ` +
      `${mean.toPrecision(3)}.`;
    delete root.dataset.error;
    if (drawn.length) {
      const estimate = average(drawn);
      root.dataset.estimate = estimate;
      text += ` ${drawn.length} random ${drawn.length > 1 ? "lines" : "line"}: ${estimate.toPrecision(3)}`;
      if (drawn.length > 1) {
        root.dataset.error = standardError(drawn);
        text += ` \\u00b1 ${standardError(drawn).toPrecision(2)}`;
      }
      text += ".";
    }
    status.textContent = text;
    slider.setAttribute("aria-valuetext", `${Math.round(degrees)} degrees, cost ${cost.toPrecision(3)}`);
  }
  function turnTo(degrees) {
    const turned = ((degrees % 180) + 180) % 180;
    slider.value = Math.floor(turned);
    draw(turned);
  }
  function sample(count) {
    stop();
    let degrees = 0;
    for (let i = 0; i < count; i += 1) {
      degrees = 180 * random();
      drawn.push(costAt(data.source, data.target, degrees));
      const height = up(drawn[drawn.length - 1]);
      make("circle", { cx: across(degrees), cy: height, r: 3.5, fill: "#D55E00", opacity: 0.6 }, samples);
    }
    turnTo(degrees);
  }
  let begun = 0, from = 0;
  function step(now) {
    if (!playing || !root.isConnected) { return; }
    const gone = (now - begun) / 1000 * 20;
    turnTo(from + (calm ? 15 * Math.floor(gone / 15) : gone));
    if (gone >= 180) { stop(); } else { requestAnimationFrame(step); }
  }
  function stop() { playing = false; find("turn").textContent = "turn"; }
  find("turn").addEventListener("click", () => {
    if (playing) { stop(); return; }
    playing = true;
    find("turn").textContent = "stop";
    begun = performance.now();
    from = Number(root.dataset.angle);
    requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => { stop(); draw(Number(slider.value)); });
  find("one").addEventListener("click", () => sample(1));
  find("ten").addEventListener("click", () => sample(10));
  find("clear").addEventListener("click", () => {
    drawn = [];
    samples.replaceChildren();
    draw(Number(root.dataset.angle));
  });
  const follow = (event) => {
    const frame = svg.getBoundingClientRect(), scale = 700 / frame.width;
    const x = (event.clientX - frame.left) * scale - middle[0], y = (event.clientY - frame.top) * scale - middle[1];
    stop();
    turnTo(Math.atan2(-y, x) * 180 / Math.PI);
  };
  plane.addEventListener("pointerdown", (event) => {
    plane.setPointerCapture(event.pointerId);
    follow(event);
  });
  plane.addEventListener("pointermove", (event) => {
    if (plane.hasPointerCapture(event.pointerId)) { follow(event); }
  });
  root.querySelector("img").hidden = true;
  for (const node of [svg, status, find("controls")]) { node.removeAttribute("hidden"); }
  draw(data.angle);
"""
