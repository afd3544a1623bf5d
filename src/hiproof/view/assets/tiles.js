"use strict";
// 3D Tiles as hiproof writes them, in a Viewer: tiles come and go with the view, and a click reads a tile's table.

const PIXELS = 16, AT_ONCE = 6, MOST_TRIANGLES = 4e6;
const METADATA = "EXT_structural_metadata";

class TileScene extends Viewer {
  // `mark` is the colour of the building selected, [red, green, blue].
  constructor(canvas, tileset, base, mark) {
    super(canvas, new Float32Array(0), new Uint32Array(0));
    this.root = tileset.root; this.base = base; this.mark = mark;
    this.loading = 0; this.time = 0; this.selected = null;
    this.onload = () => {}; this.onfail = () => {};
    this.roofColour = null;  // of a tile's row, [red, green, blue]; null leaves the colours of the tile
    this.home();
  }

  home() {
    if (!this.root) return super.home();
    this.azimuth = -0.6; this.elevation = 0.75;
    this.frame(sphere(this.root));
  }

  paint() { this.choose(); super.paint(); }

  // Which tiles to draw: those in view, downwards as long as what a tile leaves out would be seen.
  choose() {
    const wanted = [], view = { eye: this.eye(), ...this.axes() };
    const visit = tile => {
      const away = this.away(tile, view);
      if (away === null) return;
      if (tile.content) wanted.push({ tile, away });
      const height = 2 * Math.max(away, 1e-3) * Math.tan(HALF_VIEW);  // metres of the view
      const pixels = tile.geometricError * this.canvas.clientHeight / height;
      if (pixels > PIXELS) for (const child of tile.children || []) visit(child);
    };
    visit(this.root);
    this.time++;
    for (const { tile } of wanted) tile.seen = this.time;
    for (const layer of this.layers) layer.visible = layer.tile.seen === this.time;
    const missing = wanted.filter(({ tile }) => !tile.state).sort((a, b) => a.away - b.away);
    for (const { tile } of missing.slice(0, AT_ONCE - this.loading)) this.load(tile);
    this.forget();
  }

  // Metres from the eye to a tile, null where it lies outside the view.
  away(tile, { eye, back, right, up }) {
    const { middle, radius } = sphere(tile), half = Math.tan(HALF_VIEW);
    const to = middle.map((v, k) => v - eye[k]);
    const along = axis => to[0] * axis[0] + to[1] * axis[1] + to[2] * axis[2];
    const ahead = Math.max(0, -along(back)) * half, wide = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    const outside = -along(back) < -radius || Math.abs(along(up)) > ahead + 1.1 * radius
      || Math.abs(along(right)) > ahead * wide + (1 + wide) * radius;
    return outside ? null : Math.max(0, Math.hypot(...to) - radius);
  }

  async load(tile) {
    tile.state = "loading"; this.loading++;
    try {
      const answer = await fetch(this.base + tile.content.uri);
      if (!answer.ok) throw new Error(`${tile.content.uri}: ${answer.status}`);
      Object.assign(tile, readTile(await answer.arrayBuffer()), { state: "drawn" });
      tile.layer = Object.assign(this.addLayer("TRIANGLES", tile.corners, this.coloursOf(tile)), { tile });
      this.onload(tile);
    } catch (error) { tile.state = "failed"; this.onfail(error.message); }
    this.loading--;
    this.draw();
  }

  // Tiles longest out of view go when more triangles are held than a graphics card likes.
  forget() {
    const held = this.layers.map(layer => layer.tile).sort((a, b) => a.seen - b.seen);
    let triangles = held.reduce((sum, tile) => sum + tile.owner.length, 0);
    for (const tile of held) {
      if (triangles <= MOST_TRIANGLES || tile.seen === this.time) return;
      triangles -= tile.owner.length;
      this.layers.splice(this.layers.indexOf(tile.layer), 1);
      for (const part of [tile.layer.places, tile.layer.colours]) if (this.gl) this.gl.deleteBuffer(part);
      for (const name of ["state", "layer", "corners", "colours", "owner", "table", "light", "isRoof"]) delete tile[name];
    }
  }

  // The colours of a tile's corners, with roofs as the page asks for.
  coloursOf(tile) {
    const colours = tile.colours.slice(), { owner, light, isRoof } = tile;
    if (this.roofColour) for (let t = 0; t < owner.length; t++) if (isRoof[t]) {
      const base = this.roofColour(tile, owner[t]);
      for (let v = 0; v < 3; v++) for (let k = 0; k < 3; k++) colours[12 * t + 4 * v + k] = base[k] * light[t];
    }
    return colours;
  }

  recolourRoofs(colour) {
    this.roofColour = colour;
    for (const layer of this.layers) this.recolour(layer, this.coloursOf(layer.tile));
    this.select(this.selected);
  }

  // The building under a place of the canvas: its tile and its row there.
  pick(x, y) {
    const ray = this.ray(x, y);
    let found = null, far = Infinity;
    for (const { tile, visible } of this.layers) {
      const hit = visible ? nearest(tile.corners, ray) : { far };
      if (hit.far < far) { far = hit.far; found = { tile, row: tile.owner[hit.triangle] }; }
    }
    return found;
  }

  select(found) {
    const before = this.selected;
    this.selected = found;
    for (const one of [before, found]) {
      if (!one || !one.tile.layer) continue;
      const colours = this.coloursOf(one.tile), { owner } = one.tile;
      if (one === found || (found && found.tile === one.tile)) {
        for (let t = 0; t < owner.length; t++) if (owner[t] === found.row) for (let v = 0; v < 3; v++) {
          const own = colours.subarray(12 * t + 4 * v, 12 * t + 4 * v + 3), light = Math.max(...own) / 255;
          own.set(this.mark.map(part => part * light));
        }
      }
      this.recolour(one.tile.layer, colours);
    }
  }
}

function sphere(tile) {
  const box = tile.boundingVolume.box;
  return { middle: box.slice(0, 3), radius: Math.hypot(box[3], box[7], box[11]) };
}

// A tile's file: triangle corners (east, north, up), their colours, the building of each, and the table of these.
function readTile(file) {
  const head = new DataView(file), length = head.getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(new Uint8Array(file, 20, length)));
  const bytes = file.slice(28 + length), primitive = document.meshes[0].primitives[0], names = primitive.attributes;
  const array = (index, kind, width) => {
    const { bufferView, count } = document.accessors[index];
    return new kind(bytes, document.bufferViews[bufferView].byteOffset, count * width);
  };
  const wide = document.accessors[primitive.indices].componentType === 5125;
  const indices = array(primitive.indices, wide ? Uint32Array : Uint16Array, 1);
  const places = array(names.POSITION, Float32Array, 3), normals = array(names.NORMAL, Float32Array, 3);
  const painted = array(names.COLOR_0, Uint8Array, 4), ids = array(names._FEATURE_ID_0, Float32Array, 1);
  const [mx, my, mz] = document.nodes[0].translation;
  const corners = new Float32Array(3 * indices.length), colours = new Uint8Array(4 * indices.length).fill(255);
  const light = new Float32Array(indices.length / 3), isRoof = new Uint8Array(indices.length / 3);
  indices.forEach((i, at) => {
    corners[3 * at] = places[3 * i] + mx; corners[3 * at + 1] = -places[3 * i + 2] - mz; corners[3 * at + 2] = places[3 * i + 1] + my;
    const t = Math.floor(at / 3);
    light[t] = 0.72 + 0.28 * (0.35 * normals[3 * i] + 0.5 * normals[3 * i + 2] + 0.79 * normals[3 * i + 1]);
    isRoof[t] = normals[3 * i + 1] > 0.02;
    for (let k = 0; k < 3; k++) colours[4 * at + k] = light[t] * shown(painted[4 * i + k] / 255);
  });
  const owner = Uint32Array.from({ length: indices.length / 3 }, (_, t) => ids[indices[3 * t]]);
  return { corners, colours, owner, light, isRoof, table: tableOf(document, bytes) };
}

// A colour's part, linear 0..1, as displays show it, 0..255.
function shown(part) { return 255 * (part <= 0.0031308 ? 12.92 * part : 1.055 * part ** (1 / 2.4) - 0.055); }

// The table of a tile: `count`, and `row` gives the values of one by attribute's name, null where unknown.
function tableOf(document, bytes) {
  const { schema, propertyTables: [table] } = document.extensions[METADATA];
  const view = index => bytes.slice(document.bufferViews[index].byteOffset, document.bufferViews[index].byteOffset + document.bufferViews[index].byteLength);
  const columns = Object.entries(schema.classes[table.class].properties).map(([id, property]) => {
    const { values, stringOffsets } = table.properties[id];
    if (property.type !== "STRING") { const numbers = new Float64Array(view(values)); return [property, row => numbers[row]]; }
    const ends = new Uint32Array(view(stringOffsets)), text = view(values);
    return [property, row => new TextDecoder().decode(new Uint8Array(text, ends[row], ends[row + 1] - ends[row]))];
  });
  const row = number => columns.map(([property, at]) => [property, at(number)])
    .map(([property, value]) => ({ name: property.name, told: property.description, value: value === property.noData ? null : value }));
  return { count: table.count, row };
}
