import { replaceStill } from "./figure.js";
import { player } from "./player.js";

const LEVELS = 65535;
const WIDTH = 720;

// Points on their way to a contour, a panel for each loss.
export function main(root, data) {
  const last = data.steps.length - 1;
  const panels = data.panels.map((panel) => addPanel(root.querySelector(".panels"), panel, data));
  const between = (moment) => {
    const before = Math.min(Math.floor(moment), last);
    return { before, after: Math.min(before + 1, last), part: moment - before };
  };
  const { goTo } = player(root.querySelector(".controls"), {
    show: (moment) => panels.forEach((panel) => draw(panel, data, between(moment))),
    say: (moment) => {
      const { before, after, part } = between(moment);
      return "step " + Math.round(data.steps[before] + part * (data.steps[after] - data.steps[before]));
    },
    pace: { perSecond: 5, step: 0 },
    reducedPace: { perSecond: 2, step: 1 },
  });
  goTo(last);
  replaceStill(root);
}

function addPanel(holder, panel, data) {
  const [left, right, bottom, top] = data.box;
  const figure = document.createElement("figure");
  const caption = document.createElement("figcaption");
  const canvas = document.createElement("canvas");
  caption.textContent = panel.name;
  canvas.width = WIDTH;
  canvas.height = Math.round((WIDTH * (top - bottom)) / (right - left));
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", panel.name + ": points on their way to the polygon");
  figure.append(caption, canvas);
  holder.append(figure);
  const points = new Uint16Array(Uint8Array.from(atob(panel.points), (c) => c.charCodeAt(0)).buffer);
  return { canvas, colour: panel.colour, points, size: points.length / data.steps.length };
}

function draw({ canvas, colour, points, size }, data, { before, after, part }) {
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  drawContour(pen, data);
  pen.fillStyle = colour;
  for (let i = 0; i < size; i += 2) {
    const [x, y] = [i, i + 1].map((k) => {
      const start = points[before * size + k];
      return (start + part * (points[after * size + k] - start)) / LEVELS;
    });
    pen.beginPath();
    pen.arc(x * canvas.width, (1 - y) * canvas.height, 4.5, 0, 2 * Math.PI);
    pen.fill();
  }
}

function drawContour(pen, { box: [left, right, bottom, top], edges }) {
  const { width, height } = pen.canvas;
  const place = ([x, y]) => [((x - left) / (right - left)) * width, ((top - y) / (top - bottom)) * height];
  Object.assign(pen, { strokeStyle: "#8c8c8c99", lineWidth: 7, lineCap: "round" });
  pen.beginPath();
  for (const [start, end] of edges) {
    pen.moveTo(...place(start));
    pen.lineTo(...place(end));
  }
  pen.stroke();
}
