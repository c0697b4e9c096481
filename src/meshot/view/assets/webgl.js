import { bytesOf, joinedCorners, perpendicular, placed } from "./packing.js";

const VERTEX = `#version 300 es
  in vec3 place, normal; in float value; uniform mat3 turn; uniform vec3 scale; out vec3 facing; out float share;
  void main() { vec3 p = turn * place; facing = turn * normal; share = value; gl_Position = vec4(p * scale, 1.0); }`;
const FRAGMENT = `#version 300 es
  precision highp float; in vec3 facing; in float share; uniform sampler2D colours; uniform vec3 plain;
  uniform float ambient; out vec4 colour;
  void main() { float light = ambient + (1.0 - ambient) * abs(normalize(facing).z);
    vec3 own = share < -0.001 ? plain : texture(colours, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
    colour = vec4(own * light, 1.0); }`;

// Returns a function that draws a surface of the scene with a rotation and a zoom.
export function renderer(canvas, gl, data, arrays) {
  const uniform = prepare(gl, data);
  const objects = data.items.map((item) => upload(gl, data, arrays, item));
  return (shown, turn, zoom) => {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio);
    const height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      Object.assign(canvas, { width, height });
    }
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(uniform("turn"), true, turn.flat());
    const tall = zoom / data.half;
    gl.uniform3f(uniform("scale"), (tall * height) / width, tall, -0.99 / data.reach);
    gl.bindVertexArray(objects[shown].object);
    gl.drawElements(gl.TRIANGLES, objects[shown].count, gl.UNSIGNED_INT, 0);
  };
}

function prepare(gl, data) {
  const uniform = program(gl);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytesOf(data.colours));
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.uniform3fv(uniform("plain"), data.plain);
  gl.uniform1f(uniform("ambient"), data.ambient);
  gl.enable(gl.DEPTH_TEST);
  return uniform;
}

function program(gl) {
  const made = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  ["place", "normal", "value"].forEach((name, i) => gl.bindAttribLocation(made, i, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
    throw new Error(gl.getProgramInfoLog(made));
  }
  gl.useProgram(made);
  return (name) => gl.getUniformLocation(made, name);
}

function upload(gl, data, arrays, item) {
  const points = placed(arrays[item.vertices], data.low, data.step);
  const corners = joinedCorners(arrays[item.faces]);
  const n = points.length / 3;
  const values = new Float32Array(n).fill(-1);
  if (item.values >= 0) {
    arrays[item.values].forEach((v, i) => {
      values[i] = v ? (v - 1) / 254 : -1;
    });
  }
  const object = gl.createVertexArray();
  gl.bindVertexArray(object);
  [points, perpendicular(points, corners), values].forEach((array, i) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(i);
    gl.vertexAttribPointer(i, array.length / n, gl.FLOAT, false, 0, 0);
  });
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  return { object, count: corners.length };
}
