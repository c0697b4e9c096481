import { replaceStill } from "./figure.js";
import { addShape, addText } from "../../live/assets/svg.js";

// An error chosen from a list and a size from a slider: a section through the surface, and a bar for each metric.
export function main(root, data) {
  const find = (name) => root.querySelector(name);
  const [chooser, slider, status] = ["select", "input", "[role=status]"].map(find);
  const rows = root.querySelectorAll(".row");

  function show() {
    const error = data.errors[Number(chooser.value)];
    const state = error.states[Number(slider.value)];
    drawSection(find("svg"), error, state);
    const ratios = state.ratios.map((ratio) => ratio ?? Infinity);
    rows.forEach((row, k) => drawBar(row, ratios[k], state.values[k], ratios[k] > data.seen));
    const seen = data.metrics.filter((_, k) => ratios[k] > data.seen);
    slider.setAttribute("aria-valuetext", state.size);
    const verdict = seen.length ? `Detected by: ${seen.join(", ")}.` : "Detected by none of them.";
    status.textContent = `${error.name}, ${state.size}. ${verdict}`;
    Object.assign(root.dataset, { error: error.name, size: state.size, seen: seen.join("|") });
  }
  function choose() {
    const last = data.errors[Number(chooser.value)].states.length - 1;
    Object.assign(slider, { max: last, value: last, disabled: last < 1 });
    show();
  }
  chooser.addEventListener("change", choose);
  slider.addEventListener("input", show);
  choose();
  replaceStill(root);
}

function drawBar(row, ratio, text, seen) {
  // A tenth of the yardstick at the left end, a hundred times at the right, the mark at once.
  const share = Math.min(1, Math.max(0, (Math.log10(Math.max(ratio, 1e-9)) + 1) / 3));
  const bar = row.querySelector("i");
  bar.style.width = `${100 * share}%`;
  bar.className = seen ? "" : "hidden-by-noise";
  row.querySelector("b").textContent = text;
}

function drawSection(svg, error, state) {
  const right = 95 - (100 * error.bar) / error.half;
  svg.replaceChildren();
  addLines(svg, error.target, { stroke: "#8c8c8c", "stroke-width": 4, opacity: 0.6 });
  addLines(svg, state.lines, { stroke: "#D55E00", "stroke-width": 1.5 });
  addLines(svg, [right, -92, 95, -92], { stroke: "#1a1a1a", "stroke-width": 1.5 });
  addText(svg, `${error.bar} mm`, { x: 95, y: 88, "text-anchor": "end" });
}

function addLines(svg, numbers, look) {
  let d = "";
  for (let i = 0; i < numbers.length; i += 4) {
    d += `M${numbers[i]} ${-numbers[i + 1]}L${numbers[i + 2]} ${-numbers[i + 3]}`;
  }
  addShape(svg, "path", { d, fill: "none", "stroke-linecap": "round", ...look });
}
