"""The controls under a surface that deforms: which deformation, when, and a button that plays it."""

PAGE = """
<div id="@ID@" class="deformation" role="group" aria-label="@LABEL@">
<style>
.deformation { max-width: 44rem; color: inherit; }
.deformation [hidden], .deformation .surface-scene .names { display: none !important; }
.deformation .choices { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; border: 0; margin: 0; padding: .2rem 0; }
.deformation .controls { display: flex; gap: .75rem; align-items: center; flex-wrap: wrap; margin-bottom: 1rem; }
.deformation .controls button { min-width: 5rem; padding: .3rem .6rem; font: inherit; cursor: pointer; }
.deformation .controls input { flex: 1; min-width: 8rem; }
.deformation output { min-width: 5rem; font-variant-numeric: tabular-nums; }
html[data-theme="dark"] .bd-content div.cell_output .text_html:has(> .deformation):not(:has(table.dataframe)) {
  background: none; color: inherit; }
</style>
@SCENE@
<fieldset class="choices" hidden></fieldset>
<div class="controls" hidden>
<button type="button" aria-label="play or pause">&#9654; play</button>
<input type="range" min="0" max="@LAST@" step="1" value="@LAST@" aria-label="time of the deformation">
<output></output>
</div>
<script>
(function () {
  "use strict";
  const data = @DATA@;
  const root = document.getElementById("@ID@");
  const scene = root && root.querySelector(".surface-scene");
  if (!scene || !scene.showItem || root.dataset.ready) { return; }
  root.dataset.ready = "yes";
  const find = (name) => root.querySelector(name);
  const button = find(".controls button"), slider = find(".controls input"), output = find("output");
  const choices = find(".choices"), last = data.times.length - 1;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  let chosen = 0, playing = null;
  const still = () => data.choices[chosen].items.length === 1;
  function write() {
    const text = still() ? "it rests" : "t = " + data.times[slider.value].toFixed(2);
    output.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    slider.disabled = button.disabled = still();
  }
  function draw() {
    const items = data.choices[chosen].items;
    scene.showItem(items[Math.min(slider.value, items.length - 1)]);
    write();
  }
  function stop() {
    clearInterval(playing);
    playing = null;
    button.textContent = "\\u25b6 play";
  }
  function next() {
    if (!root.isConnected || Number(slider.value) >= last) { stop(); return; }
    slider.value = Number(slider.value) + 1;
    draw();
  }
  button.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (Number(slider.value) >= last) { slider.value = 0; draw(); }
    button.textContent = "\\u275a\\u275a pause";
    playing = setInterval(next, calm ? 500 : 100);
  });
  slider.addEventListener("input", () => { stop(); draw(); });
  data.choices.forEach((choice, i) => {
    const label = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "radio", name: root.id, checked: i === 0 });
    box.addEventListener("change", () => { chosen = i; if (still()) { stop(); } draw(); });
    label.append(box, " " + choice.name);
    choices.append(label);
  });
  choices.hidden = data.choices.length < 2;
  find(".controls").hidden = false;
  write();
})();
</script>
</div>
"""
