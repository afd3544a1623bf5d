"use strict";
// A small WebGL view of triangles, lines and points: orbit, pan, zoom and picking, all data in typed arrays. Shared by all our
// pages.

const HALF_VIEW = 0.4;  // radians between the middle of the view and its upper edge
const LEAST_DISTANCE = 8;  // metres; an empty scene has no size
const MARGIN = 1.05;  // of the scene's radius, so that nothing touches the edge of the canvas
const TURN_STEP = 0.1, MOVE_STEP = 40, ZOOM_STEP = 1.2;  // of a key: radians, pixels, times
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const VERTEX = `
attribute vec3 place; attribute vec4 colour; uniform mat4 matrix; uniform float size; varying vec4 tint;
void main() { gl_Position = matrix * vec4(place, 1.0); gl_PointSize = size; tint = colour; }`;
const FRAGMENT = `precision mediump float; varying vec4 tint; void main() { gl_FragColor = tint; }`;

class Viewer {
  // corners: Float32Array of triangle corners; owner: building of each triangle; z is up.
  constructor(canvas, corners, owner) {
    this.canvas = canvas; this.setMesh(corners, owner);
    this.gl = canvas.getContext("webgl", { antialias: true });
    this.layers = []; this.onpick = () => {}; this.onpaint = () => {}; this.request = 0;
    this.home();
    if (!this.gl) return;
    this.program = link(this.gl);
    this.listen();
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  // What is picked from; drawn are the layers.
  setMesh(corners, owner) { this.corners = corners; this.owner = owner; }

  clearLayers() {
    for (const layer of this.layers) for (const held of [layer.places, layer.colours]) if (held) this.gl.deleteBuffer(held);
    this.layers = [];
  }

  home() { this.azimuth = -0.6; this.elevation = 0.75; this.frame(sphereOf(this.corners)); }

  // Look at a sphere from where all of it is seen, until the view is moved or zoomed.
  frame({ middle, radius }) {
    this.target = middle.slice(); this.framed = radius; this.distance = this.framing(radius);
    this.draw();
  }

  // How far off a sphere of this radius fits into the view, upright and across.
  framing(radius) {
    const aspect = (this.canvas.clientWidth || 1) / (this.canvas.clientHeight || 1);
    const half = Math.min(HALF_VIEW, Math.atan(Math.tan(HALF_VIEW) * aspect));
    return Math.max(LEAST_DISTANCE, MARGIN * radius / Math.sin(half));
  }

  resize() {
    if (this.framed !== null) this.distance = this.framing(this.framed);
    this.draw();
  }

  // kind: "TRIANGLES", "LINES" or "POINTS"; colours: Uint8Array, four a vertex; the layer returned can be recoloured.
  addLayer(kind, places, colours) {
    const layer = { kind, count: places.length / 3, visible: true };
    if (this.gl) { layer.places = buffer(this.gl, places); layer.colours = buffer(this.gl, colours); }
    this.layers.push(layer);
    return layer;
  }

  recolour(layer, colours) {
    if (!this.gl) return;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, layer.colours);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, colours, this.gl.STATIC_DRAW);
    this.draw();
  }

  turn(right, down) {
    this.azimuth -= right;
    this.elevation = Math.min(1.55, Math.max(-0.1, this.elevation + down));
    this.draw();
  }

  // Move the scene by pixels of the canvas.
  move(x, y) {
    const { right, up } = this.axes();
    const step = 2 * Math.tan(HALF_VIEW) * this.distance / this.canvas.clientHeight;
    this.target = this.target.map((t, k) => t - step * (x * right[k] - y * up[k]));
    this.framed = null;
    this.draw();
  }

  zoom(factor) { this.distance *= factor; this.framed = null; this.draw(); }

  axes() {
    const ce = Math.cos(this.elevation), se = Math.sin(this.elevation), ca = Math.cos(this.azimuth), sa = Math.sin(this.azimuth);
    return { back: [sa * ce, -ca * ce, se], right: [ca, sa, 0], up: [-sa * se, ca * se, ce] };
  }

  matrix() {
    const { back, right, up } = this.axes(), eye = this.eye();
    const near = this.distance / 50, far = this.distance * 60, f = 1 / Math.tan(HALF_VIEW);
    const aspect = this.canvas.width / Math.max(1, this.canvas.height);
    const rows = [right.map(v => v * f / aspect), up.map(v => v * f), back];
    const shift = rows.map(row => -(row[0] * eye[0] + row[1] * eye[1] + row[2] * eye[2]));
    const a = (far + near) / (near - far), b = 2 * far * near / (near - far);
    const depth = back.map(v => v * a), m = new Float32Array(16);
    for (let k = 0; k < 3; k++) { m[4 * k] = rows[0][k]; m[4 * k + 1] = rows[1][k]; m[4 * k + 2] = depth[k]; m[4 * k + 3] = -back[k]; }
    m[12] = shift[0]; m[13] = shift[1]; m[14] = shift[2] * a + b; m[15] = -shift[2];
    return m;
  }

  draw() {
    if (!this.gl || this.request) return;
    this.request = requestAnimationFrame(() => { this.request = 0; this.paint(); });
  }

  paint() {
    const gl = this.gl, ratio = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * ratio), height = Math.round(this.canvas.clientHeight * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) { this.canvas.width = width; this.canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.93, 0.945, 0.957, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.useProgram(this.program);
    // Faces are pushed back a little so that their own edges and points stay visible.
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 2);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.program, "matrix"), false, this.matrix());
    gl.uniform1f(gl.getUniformLocation(this.program, "size"), Math.max(2, Math.min(6, 160 / this.distance)) * ratio);
    for (const layer of this.layers) {
      if (!layer.visible || !layer.count) continue;
      attribute(gl, this.program, "place", layer.places, 3, gl.FLOAT, false);
      attribute(gl, this.program, "colour", layer.colours, 4, gl.UNSIGNED_BYTE, true);
      gl.drawArrays(gl[layer.kind], 0, layer.count);
    }
    this.onpaint();
  }

  listen() {
    const canvas = this.canvas;
    let held = null, moved = 0;
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener("pointerdown", event => {
      held = event.button === 2 || event.shiftKey ? "pan" : "turn"; moved = 0; canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", event => {
      if (!held) return;
      moved += Math.abs(event.movementX) + Math.abs(event.movementY);
      if (held === "turn") this.turn(event.movementX * 0.008, event.movementY * 0.008);
      else this.move(event.movementX, event.movementY);
    });
    canvas.addEventListener("pointerup", event => {
      if (held && moved < 5) this.pickAt(event.offsetX, event.offsetY);
      held = null;
    });
    canvas.addEventListener("wheel", event => {
      event.preventDefault(); this.zoom(Math.exp(event.deltaY * 0.001));
    }, { passive: false });
    canvas.addEventListener("keydown", event => this.press(event));
  }

  // What the mouse does, by keys.
  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key], { clientWidth, clientHeight } = this.canvas;
    if (arrow && event.shiftKey) this.move(...arrow.map(step => -MOVE_STEP * step));
    else if (arrow) this.turn(...arrow.map(step => TURN_STEP * step));
    else if (event.key === "+" || event.key === "=") this.zoom(1 / ZOOM_STEP);
    else if (event.key === "-") this.zoom(ZOOM_STEP);
    else if (event.key === "Home") this.home();
    else if (event.key === "Enter") this.pickAt(clientWidth / 2, clientHeight / 2);
    else return;
    event.preventDefault();
  }

  pickAt(x, y) {
    const found = this.pick(x, y);
    if (found !== null) this.onpick(found, x, y);
  }

  // Building under a place of the canvas (CSS pixels), null for none.
  pick(x, y) {
    const { triangle } = nearest(this.corners, this.ray(x, y));
    return triangle < 0 ? null : this.owner[triangle];
  }

  // The ray from the eye through a place of the canvas.
  ray(x, y) {
    const { back, right, up } = this.axes(), half = Math.tan(HALF_VIEW);
    const u = (2 * x / this.canvas.clientWidth - 1) * half * this.canvas.clientWidth / this.canvas.clientHeight;
    const v = (1 - 2 * y / this.canvas.clientHeight) * half;
    return { eye: this.eye(), way: back.map((b, k) => -b + u * right[k] + v * up[k]) };
  }

  eye() { const { back } = this.axes(); return this.target.map((t, k) => t + this.distance * back[k]); }

  // The place in the scene under a place of the canvas, null for none.
  placeUnder(x, y) {
    const ray = this.ray(x, y), { triangle, far } = nearest(this.corners, ray);
    return triangle < 0 ? null : ray.eye.map((e, k) => e + far * ray.way[k]);
  }

  // Where a place of the scene falls on the canvas, CSS pixels.
  project(place) {
    const m = this.matrix(), at = k => m[k] * place[0] + m[4 + k] * place[1] + m[8 + k] * place[2] + m[12 + k];
    return [(at(0) / at(3) + 1) / 2 * this.canvas.clientWidth, (1 - at(1) / at(3)) / 2 * this.canvas.clientHeight];
  }
}

// The sphere about the middle of all corners; one of no size where there are none.
function sphereOf(corners) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  if (!corners.length) return { middle: [0, 0, 0], radius: 0 };
  corners.forEach((v, i) => {
    low[i % 3] = Math.min(low[i % 3], v); high[i % 3] = Math.max(high[i % 3], v);
  });
  const [x, y, z] = low.map((v, k) => (v + high[k]) / 2);
  let radius = 0;
  for (let i = 0; i < corners.length; i += 3) {
    radius = Math.max(radius, Math.hypot(corners[i] - x, corners[i + 1] - y, corners[i + 2] - z));
  }
  return { middle: [x, y, z], radius };
}

// The triangle that a ray meets first, and how far along; -1 for none (Moller and Trumbore).
function nearest(corners, { eye, way }) {
  const c = corners, found = { triangle: -1, far: Infinity };
  for (let t = 0, i = 0; i < c.length; t++, i += 9) {
    const ax = c[i + 3] - c[i], ay = c[i + 4] - c[i + 1], az = c[i + 5] - c[i + 2];
    const bx = c[i + 6] - c[i], by = c[i + 7] - c[i + 1], bz = c[i + 8] - c[i + 2];
    const px = way[1] * bz - way[2] * by, py = way[2] * bx - way[0] * bz, pz = way[0] * by - way[1] * bx;
    const det = ax * px + ay * py + az * pz;
    if (Math.abs(det) < 1e-12) continue;
    const sx = eye[0] - c[i], sy = eye[1] - c[i + 1], sz = eye[2] - c[i + 2];
    const s = (sx * px + sy * py + sz * pz) / det;
    if (s < 0 || s > 1) continue;
    const qx = sy * az - sz * ay, qy = sz * ax - sx * az, qz = sx * ay - sy * ax;
    const r = (way[0] * qx + way[1] * qy + way[2] * qz) / det;
    if (r < 0 || s + r > 1) continue;
    const far = (bx * qx + by * qy + bz * qz) / det;
    if (far > 0 && far < found.far) { found.far = far; found.triangle = t; }
  }
  return found;
}

function link(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source); gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

function buffer(gl, values) {
  const made = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, made); gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  return made;
}

function attribute(gl, program, name, source, size, kind, normalised) {
  const place = gl.getAttribLocation(program, name);
  gl.bindBuffer(gl.ARRAY_BUFFER, source); gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, kind, normalised, 0, 0);
}

// Base64 of little-endian numbers as they were packed, such as unpacked(text, Float32Array).
function unpacked(text, Kind) { return new Kind(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer); }

// [red, green, blue] of "#rrggbb".
function rgb(colour) { return [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16)); }

// The entry of the legend that lists a roof type, and its colour.
function entryOf(colours, type) { return colours.legends[type] || "other"; }
function typeColour(colours, type) { return colours.type[entryOf(colours, type)]; }

// What people call a roof type.
function typeWords(colours, type) { return colours.words[type] || type; }

// Let the styles know the colour of what is selected.
function showMark(colours) { document.documentElement.style.setProperty("--mark", colours.mark); }

// A list of [name, colour].
function showLegend(entries) {
  document.getElementById("legend").replaceChildren(...entries.map(([name, colour]) => {
    const item = document.createElement("li"), swatch = document.createElement("i");
    swatch.style.background = colour; item.append(swatch, name);
    return item;
  }));
}

// Text from files, in which marks of direction are shown by their codes: they would turn its line.
const plainly = text => String(text ?? "").replace(/[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]/g,
  mark => `\\u${mark.charCodeAt(0).toString(16).padStart(4, "0")}`);

// A row of a table whose first cell heads the others.
function headedRow(name, ...values) {
  const row = document.createElement("tr");
  const cell = (kind, value) => Object.assign(document.createElement(kind), { textContent: plainly(value) });
  row.append(cell("th", name), ...values.map(value => cell("td", value)));
  row.firstChild.scope = "row";
  return row;
}

// The colour of a distance: `stops` are [from, colour] upwards.
function colourByStops(stops, value) {
  let colour = stops[0][1];
  for (const [from, name] of stops) if (value >= from) colour = name;
  return colour;
}

// Triangles shaded once by their slope to a fixed light, so that no normals are sent to the graphics card.
function lightOf(corners) {
  const light = new Float32Array(corners.length / 9);
  for (let t = 0, i = 0; t < light.length; t++, i += 9) {
    const c = corners, a = [0, 1, 2].map(k => c[i + 3 + k] - c[i + k]), b = [0, 1, 2].map(k => c[i + 6 + k] - c[i + k]);
    const n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    light[t] = 0.72 + 0.28 * (0.35 * n[0] - 0.5 * n[1] + 0.79 * n[2]) / (Math.hypot(...n) || 1);
  }
  return light;
}

// Colours of triangles, four bytes a vertex: `colourAt` gives [red, green, blue] of a triangle.
function shadedColours(light, colourAt) {
  const colours = new Uint8Array(12 * light.length).fill(255);
  for (let t = 0; t < light.length; t++) {
    const base = colourAt(t);
    for (let v = 0; v < 3; v++) for (let k = 0; k < 3; k++) colours[12 * t + 4 * v + k] = base[k] * light[t];
  }
  return colours;
}
