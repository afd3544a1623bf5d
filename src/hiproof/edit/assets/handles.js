"use strict";
// Handles on the chosen part: each is a place of the scene and the direction in which it moves a parameter.

const UP = [0, 0, 1], EAST = [1, 0, 0], NORTH = [0, 1, 0], LEAST_PIXELS = 3;

// The handles of a part from its rectangle `h` (as the server tells it): name, sign, place (3), directions (1 or 2 of 3), and
// `change`, which makes of metres moved what the edit asks for; `z` is the height of the origin.
function handlesOf(h, part, z) {
  if (!h || !h.place) return [];
  const u = [Math.cos(h.turn), Math.sin(h.turn), 0], v = [-u[1], u[0], 0];
  const at = (a, b, height) => [h.place[0] + a * u[0] + b * v[0], h.place[1] + a * u[1] + b * v[1], height];
  const edge = (name, axis, sign, side) => ({
    name, sign: "■", place: side === "length" ? at(sign * h.length / 2, 0, h.eave) : at(0, sign * h.width / 2, h.eave), along: [axis],
    change: ([d]) => ({ [side]: Math.max(0.3, h[side] + sign * d), position: [h.place[0] + axis[0] * d / 2, h.place[1] + axis[1] * d / 2, part.position[2]] }),
  });
  const ridge = { name: "ridge", sign: "▲", place: at(0, 0, h.ridge), along: [UP], change: ([d]) => ({ ridge_height: z + h.ridge + d }) };
  const move = {
    name: "move", sign: "✥", place: at(0.25 * h.length, 0, h.eave), along: [EAST, NORTH],
    change: ([dx, dy]) => ({ position: [h.place[0] + dx, h.place[1] + dy, part.position[2]] }),
  };
  const eave = {
    name: "eave", sign: "▼", place: at(-0.3 * h.length, -h.width / 2, h.eave), along: [UP],
    change: ([d]) => ({ eave_height: z + h.eave + d, ridge_height: z + h.ridge }),
  };
  const sides = [edge("left", u, -1, "length"), edge("right", u, 1, "length"), edge("front", v, -1, "width"), edge("back", v, 1, "width")];
  return [...sides, move, ...(h.ridge > h.eave ? [eave] : []), ridge];
}

// Metres along each direction that the pointer has moved by `pixels` (2), as the scene is seen.
function metresMoved(viewer, handle, pixels) {
  const from = viewer.project(handle.place);
  const seen = handle.along.map(d => viewer.project(handle.place.map((p, k) => p + d[k])).map((v, k) => v - from[k]));
  if (seen.length === 1) {
    const [[a, b]] = seen, length = a * a + b * b;
    return [length < LEAST_PIXELS ** 2 ? 0 : (pixels[0] * a + pixels[1] * b) / length];
  }
  const [[a, c], [b, d]] = seen, det = a * d - b * c;
  return Math.abs(det) < LEAST_PIXELS ** 2 ? [0, 0] : [(pixels[0] * d - pixels[1] * b) / det, (pixels[1] * a - pixels[0] * c) / det];
}

// Draws handles over the view and tells of drags: `ondrag(handle, change)` while the hand moves, `ondrop(handle)` after.
class Handles {
  constructor(viewer, layer) {
    this.viewer = viewer; this.layer = layer; this.shown = []; this.held = null;
    this.ondrag = () => {}; this.ondrop = () => {};
    viewer.onpaint = () => this.place();
  }

  show(handles) {
    if (this.held) { handles.forEach((handle, i) => { if (this.shown[i]) this.shown[i].handle = handle; }); this.place(); return; }
    this.shown = handles.map(handle => {
      const element = document.createElement("div");
      element.className = `handle ${handle.name}`; element.dataset.handle = handle.name; element.textContent = handle.sign; element.title = `drag: ${handle.name}`;
      element.addEventListener("pointerdown", event => this.take(event, element, handle));
      element.addEventListener("pointermove", event => this.move(event));
      for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => this.drop());
      return { element, handle };
    });
    this.layer.replaceChildren(...this.shown.map(entry => entry.element));
    this.place();
  }

  place() {
    for (const { element, handle } of this.shown) {
      const [x, y] = this.viewer.project(handle.place);
      element.style.left = `${x}px`; element.style.top = `${y}px`;
    }
  }

  take(event, element, handle) {
    event.preventDefault();
    this.held = { handle, x: event.clientX, y: event.clientY, moved: false };
    element.setPointerCapture(event.pointerId);
  }

  move(event) {
    if (!this.held) return;
    const { handle, x, y } = this.held, metres = metresMoved(this.viewer, handle, [event.clientX - x, event.clientY - y]);
    this.held.moved = true;
    this.ondrag(handle, handle.change(metres));
  }

  drop() {
    if (!this.held) return;
    const { handle, moved } = this.held;
    this.held = null;
    if (moved) this.ondrop(handle);
  }
}
