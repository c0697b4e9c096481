import { replaceStill } from "./figure.js";
import { crossingPairs, cut, moved, velocities } from "./triangles.js";

const BOX = { left: -1.6, right: 1.6, bottom: -2.04, top: 1.4 };

// Two triangles under a flow of their points, with sliders for time, Euler steps and the pieces of each side.
export function main(root, data) {
  const pen = root.querySelector("canvas").getContext("2d");
  const slider = (name) => root.querySelector("input." + name);
  const say = (name, words) => {
    slider(name).nextElementSibling.textContent = words;
  };

  function draw() {
    const name = root.querySelector("input[type=radio]:checked").value;
    const field = data.fields[name];
    const [time, steps] = ["time", "steps"].map((key) => Number(slider(key).value));
    const pieces = 2 ** Number(slider("pieces").value);
    const flow = { time, steps, velocity: (x, y) => velocities[name](field, x, y) };
    say("time", time.toFixed(2));
    say("steps", steps);
    say("pieces", pieces);
    pen.clearRect(0, 0, pen.canvas.width, pen.canvas.height);
    drawGrid(pen, flow);
    const shapes = data.corners.map((corners) => moved(flow, cut(corners, pieces)));
    shapes.forEach((shape, i) => {
      drawShape(pen, shape, moved(flow, cut(data.corners[i], 64)), data.colours[i], pieces > 4 ? 3 : 6);
    });
    judge(root, crossingPairs(shapes), (time / steps) * field.lipschitz);
  }
  root.querySelectorAll("input").forEach((input) => input.addEventListener("input", draw));
  draw();
  replaceStill(root);
}

function judge(root, found, bound) {
  Object.assign(root.dataset, { pairs: found, bound });
  const points = bound < 1 ? "below 1: no two points of the plane meet" : "not below 1: points may meet";
  const many = found === 1 ? "One pair" : found + " pairs";
  const sides = document.createElement("strong");
  sides.textContent = found ? many + " of straight sides cross." : "No sides cross.";
  const start = `Step times Lipschitz constant: ${bound.toFixed(3)}, ${points}. `;
  root.querySelector(".verdict").replaceChildren(start, sides);
}

function drawGrid(pen, flow) {
  const fine = Array.from({ length: 161 }, (_, i) => -2 + i / 40);
  Object.assign(pen, { lineWidth: 1, strokeStyle: "#bbbbbb" });
  for (let k = -8; k <= 8; k++) {
    for (const line of [fine.map((s) => [k / 4, s]), fine.map((s) => [s, k / 4])]) {
      trace(pen, moved(flow, line), false);
      pen.stroke();
    }
  }
}

function drawShape(pen, shape, curve, colour, size) {
  trace(pen, shape, true);
  Object.assign(pen, { fillStyle: colour + "59", strokeStyle: colour, lineWidth: 4 });
  pen.fill();
  pen.stroke();
  trace(pen, curve, true);
  Object.assign(pen, { strokeStyle: "#404040", lineWidth: 2, fillStyle: "#1a1a1a" });
  pen.setLineDash([3, 6]);
  pen.stroke();
  pen.setLineDash([]);
  for (const point of shape) {
    pen.beginPath();
    pen.arc(...seen(pen, point), size, 0, 2 * Math.PI);
    pen.fill();
  }
}

function trace(pen, points, closed) {
  pen.beginPath();
  points.forEach((point) => pen.lineTo(...seen(pen, point)));
  if (closed) {
    pen.closePath();
  }
}

function seen({ canvas }, [x, y]) {
  const { left, right, bottom, top } = BOX;
  return [((x - left) / (right - left)) * canvas.width, ((top - y) / (top - bottom)) * canvas.height];
}
