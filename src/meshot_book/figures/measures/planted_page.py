"""The page on which a reader plants an error and sees what each metric says: style, controls and script."""

from meshot.view import OPENING

PAGE = (
    """
<div id="@ID@" class="planted" role="group" aria-label="@LABEL@">
<style>
.planted { max-width: 44rem; padding: .5rem; border-radius: 4px; background: #fff; color: #1a1a1a; }
.planted [hidden] { display: none !important; }
.planted img { max-width: 100%; background: #fff; }
.planted .parts { display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: flex-start; }
.planted svg { flex: 1 1 17rem; max-width: 22rem; background: #fff; }
.planted svg text { font-family: sans-serif; fill: #1a1a1a; }
.planted .bars { flex: 1 1 17rem; font-size: .9rem; }
.planted .controls { display: flex; gap: .5rem .75rem; align-items: center; margin: .3rem 0; flex-wrap: wrap; }
.planted select { font: inherit; padding: .2rem; color: #1a1a1a; background: #fff; }
.planted input { flex: 1; min-width: 7rem; }
.planted label, .planted p { color: #1a1a1a; }
.planted p { margin: .4rem 0; font-variant-numeric: tabular-nums; }
.planted .row { display: grid; grid-template-columns: 8.5rem 1fr 4.6rem; gap: .4rem; align-items: center; }
.planted .row b { font-weight: normal; text-align: right; font-variant-numeric: tabular-nums; }
.planted .track { position: relative; height: .9rem; margin: .12rem 0; background: #eee; overflow: hidden; }
.planted .track i { position: absolute; top: 0; bottom: 0; left: 0; background: #0072B2; }
.planted .track i.hidden-by-noise { background: #b5b5b5; }
.planted .track u { position: absolute; top: 0; bottom: 0; left: 33.333%; border-left: 2px solid #1a1a1a; }
</style>
<img alt="@LABEL@" src="data:image/png;base64,@STILL@">
<div class="controls" hidden>
<label>error <select>@OPTIONS@</select></label>
<label class="grow">size <input type="range" min="0" max="0" step="1" value="0"></label>
</div>
<div class="parts" hidden>
<svg viewBox="-100 -100 200 200" role="img" aria-label="section through the surface"></svg>
<div class="bars"></div>
</div>
<p role="status" hidden></p>
</div>
<script>
"""
    + OPENING
    + """  @BEHAVIOUR@
})();
</script>
"""
)

BEHAVIOUR = """
  const SVG = "http://www.w3.org/2000/svg", find = (name) => root.querySelector(name);
  const svg = find("svg"), chooser = find("select"), slider = find("input"), status = find("p"), bars = find(".bars");
  // A tenth of the yardstick at the left end, a hundred times at the right, the mark at once.
  const width = (ratio) => 100 * Math.min(1, Math.max(0, (Math.log10(Math.max(ratio, 1e-9)) + 1) / 3));
  const path = (numbers) => {
    let text = "";
    for (let i = 0; i < numbers.length; i += 4) {
      text += `M${numbers[i]} ${-numbers[i + 1]}L${numbers[i + 2]} ${-numbers[i + 3]}`;
    }
    return text;
  };
  const draw = (numbers, colour, thickness, opacity) => {
    const line = document.createElementNS(SVG, "path");
    const look = { d: path(numbers), stroke: colour, "stroke-width": thickness, opacity, fill: "none",
                   "stroke-linecap": "round" };
    for (const [key, value] of Object.entries(look)) { line.setAttribute(key, value); }
    svg.append(line);
  };
  const rows = data.metrics.map((name) => {
    const row = document.createElement("div");
    row.className = "row";
    row.innerHTML = '<span></span><div class="track"><i></i><u></u></div><b></b>';
    row.firstChild.textContent = name;
    bars.append(row);
    return row;
  });
  const note = document.createElement("p");
  note.textContent = data.note;
  bars.append(note);
  function show() {
    const error = data.errors[Number(chooser.value)], state = error.states[Number(slider.value)];
    svg.replaceChildren();
    draw(error.target, "#8c8c8c", 4, 0.6);
    draw(state.lines, "#D55E00", 1.5, 1);
    const right = 95 - 100 * error.bar / error.half;
    draw([right, -92, 95, -92], "#1a1a1a", 1.5, 1);
    const words = document.createElementNS(SVG, "text");
    for (const [key, value] of Object.entries({ x: 95, y: 88, "text-anchor": "end", "font-size": 9 })) {
      words.setAttribute(key, value);
    }
    words.textContent = `${error.bar} mm`;
    svg.append(words);
    const seen = [];
    state.values.forEach((text, k) => {
      const ratio = state.ratios[k] === null ? Infinity : state.ratios[k], bar = rows[k].querySelector("i");
      bar.style.width = `${width(ratio)}%`;
      bar.className = ratio > data.seen ? "" : "hidden-by-noise";
      rows[k].querySelector("b").textContent = text;
      if (ratio > data.seen) { seen.push(data.metrics[k]); }
    });
    slider.setAttribute("aria-valuetext", state.size);
    status.textContent = `${error.name}, ${state.size}. ` +
      (seen.length ? `Seen by: ${seen.join(", ")}.` : "Seen by none of them.");
    Object.assign(root.dataset, { error: error.name, size: state.size, seen: seen.join("|") });
  }
  function choose() {
    const states = data.errors[Number(chooser.value)].states;
    slider.max = states.length - 1;
    slider.disabled = states.length < 2;
    slider.value = states.length - 1;
    show();
  }
  chooser.addEventListener("change", choose);
  slider.addEventListener("input", show);
  find("img").hidden = true;
  for (const node of [find(".controls"), find(".parts"), status]) { node.removeAttribute("hidden"); }
  choose();
"""
