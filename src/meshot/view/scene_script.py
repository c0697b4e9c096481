"""The viewer of an interactive view, in WebGL 2; ``scene.py`` says how the data are packed."""

from meshot.view.page import OPENING

SCRIPT = (
    "\n"
    + OPENING
    + r"""  const find = (name) => root.querySelector(name);
  const stage = find(".stage"), start = find(".start"), hint = find(".hint"), help = find(".help");
  const names = find(".names");
  let shown = 0, stop = null, show = (calm) => open(calm);

  // Integers: differences zigzagged into three planes of bytes, so that small ones deflate well.
  async function unpack() {
    const bytes = Uint8Array.from(atob(data.packed), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    let from = 0;
    return data.lengths.map((n) => {
      const numbers = new Int32Array(n);
      for (let i = 0; i < n; i++) {
        const z = planes[from + i] | planes[from + n + i] << 8 | planes[from + 2 * n + i] << 16;
        numbers[i] = (z >>> 1) ^ -(z & 1);
      }
      from += 3 * n;
      return numbers;
    });
  }
  function placed(d) {
    const n = d.length / 3, points = new Float32Array(d.length);
    for (let k = 0; k < 3; k++) {
      for (let i = 0, sum = 0; i < n; i++) { sum += d[k * n + i]; points[3 * i + k] = data.low[k] + sum * data.step; }
    }
    return points;
  }
  function joined(d) {
    const n = d.length / 3, corners = new Uint32Array(d.length);
    for (let i = 0, first = 0; i < n; i++) {
      first += d[i];
      corners.set([first, first + d[n + i], first + d[2 * n + i]], 3 * i);
    }
    return corners;
  }
  function perpendicular(p, f) {
    const normals = new Float32Array(p.length);
    for (let i = 0; i < f.length; i += 3) {
      const a = 3 * f[i], b = 3 * f[i + 1], c = 3 * f[i + 2];
      const u = [0, 1, 2].map((k) => p[b + k] - p[a + k]), v = [0, 1, 2].map((k) => p[c + k] - p[a + k]);
      for (let k = 0; k < 3; k++) {
        const x = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
        normals[a + k] += x; normals[b + k] += x; normals[c + k] += x;
      }
    }
    return normals;
  }
  function program(gl) {
    const made = gl.createProgram();
    const parts = [[gl.VERTEX_SHADER, `#version 300 es
      in vec3 place, normal; in float value; uniform mat3 turn; uniform vec3 scale; out vec3 facing; out float share;
      void main() { vec3 p = turn * place; facing = turn * normal; share = value;
        gl_Position = vec4(p * scale, 1.0); }`], [gl.FRAGMENT_SHADER, `#version 300 es
      precision highp float; in vec3 facing; in float share; uniform sampler2D colours; uniform vec3 plain;
      uniform float ambient; out vec4 colour;
      void main() { float light = ambient + (1.0 - ambient) * abs(normalize(facing).z);
        vec3 own = share < 0.0 ? plain : texture(colours, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
        colour = vec4(own * light, 1.0); }`]];
    for (const [kind, source] of parts) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(made, shader);
    }
    ["place", "normal", "value"].forEach((name, i) => gl.bindAttribLocation(made, i, name));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) { throw new Error(gl.getProgramInfoLog(made)); }
    gl.useProgram(made);
    return (name) => gl.getUniformLocation(made, name);
  }
  function upload(gl, arrays) {
    return data.items.map((item) => {
      const points = placed(arrays[item.vertices]), corners = joined(arrays[item.faces]);
      const n = points.length / 3, values = new Float32Array(n).fill(-1);
      if (item.values >= 0) { arrays[item.values].forEach((v, i) => { values[i] = v ? (v - 1) / 254 : -1; }); }
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
    });
  }
  function prepare(gl) {
    const uniform = program(gl);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const ramp = Uint8Array.from(atob(data.colours), (c) => c.charCodeAt(0));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, ramp);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.uniform3fv(uniform("plain"), data.plain);
    gl.uniform1f(uniform("ambient"), data.ambient);
    gl.enable(gl.DEPTH_TEST);
    return uniform;
  }
  const times = (a, b) => a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
  const about = (axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return axis ? [[c, 0, s], [0, 1, 0], [-s, 0, c]] : [[1, 0, 0], [0, c, -s], [0, s, c]];
  };

  async function open(calm) {
    if (stop) { return; }
    stop = () => {};
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    let objects, uniform;
    try {
      if (!gl) { throw new Error("WebGL 2 is missing in this browser"); }
      if (!window.DecompressionStream) { throw new Error("this browser is too old"); }
      objects = upload(gl, await unpack());
      uniform = prepare(gl);
    } catch (error) {
      hint.textContent = "Only the still can be shown: " + error.message + ".";
      return;
    }
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", root.getAttribute("aria-label") + ". " + help.firstChild.textContent);
    stage.append(canvas);
    start.hidden = true;
    help.hidden = false;
    let turn = data.turn, zoom = 1, waiting = false;
    function draw() {
      waiting = false;
      const ratio = window.devicePixelRatio || 1;
      const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
      if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      gl.viewport(0, 0, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix3fv(uniform("turn"), true, turn.flat());
      const tall = zoom / data.half;
      gl.uniform3f(uniform("scale"), tall * height / width, tall, -0.99 / data.reach);
      gl.bindVertexArray(objects[shown].object);
      gl.drawElements(gl.TRIANGLES, objects[shown].count, gl.UNSIGNED_INT, 0);
    }
    function redraw() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }
    const rotate = (x, y) => { turn = times(about(0, y), times(about(1, x), turn)); redraw(); };
    const enlarge = (factor) => { zoom = Math.min(20, Math.max(0.3, zoom * factor)); redraw(); };
    const fingers = new Map();
    const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) { return; }
      const before = fingers.size === 2 ? spread() : 0, dx = event.clientX - finger.x, dy = event.clientY - finger.y;
      Object.assign(finger, { x: event.clientX, y: event.clientY });
      if (fingers.size === 1) { rotate(dx / 150, dy / 150); } else if (before) { enlarge(spread() / before); }
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      enlarge(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
    }, { passive: false });
    const keys = {
      ArrowLeft: () => rotate(-0.1, 0), ArrowRight: () => rotate(0.1, 0), ArrowUp: () => rotate(0, -0.1),
      ArrowDown: () => rotate(0, 0.1), "+": () => enlarge(1.15), "=": () => enlarge(1.15), "-": () => enlarge(1 / 1.15),
      0: () => { turn = data.turn; zoom = 1; redraw(); }, Escape: () => stop(),
    };
    canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) { return; }
      event.preventDefault();
      event.stopPropagation();
      keys[event.key]();
    });
    const watch = new ResizeObserver(redraw);
    watch.observe(canvas);
    show = redraw;
    stop = () => {
      watch.disconnect();
      canvas.remove();
      gl.getExtension("WEBGL_lose_context")?.loseContext();
      start.hidden = false;
      help.hidden = true;
      show = (calm) => open(calm);
      stop = null;
      start.focus();
    };
    if (calm !== true) { canvas.focus({ preventScroll: true }); }
    draw();
  }
  hint.textContent = "click, or press Enter, to turn it";
  start.addEventListener("click", open);
  find(".back").addEventListener("click", () => stop && stop());
  root.showItem = (i) => { shown = i; show(true); };  // for controls of a page, which keep the focus
  if (data.items.length > 1) {
    names.hidden = false;
    data.items.forEach((item, i) => {
      const label = document.createElement("label"), choice = document.createElement("input");
      Object.assign(choice, { type: "radio", name: root.id, checked: i === 0 });
      choice.addEventListener("change", () => { shown = i; show(); });
      label.append(choice, " " + item.name);
      names.append(label);
    });
  }
})();
"""
)
