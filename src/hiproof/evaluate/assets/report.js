// The page's behaviour: one selected building and one way of colouring, shown on the map, in 3D and in the panel.

const data = JSON.parse(document.getElementById("data").textContent);
const mesh = {
  corners: unpacked(data.mesh.corners, Float32Array), owner: unpacked(data.mesh.owner, Uint32Array),
  roof: unpacked(data.mesh.roof, Uint8Array), edges: unpacked(data.mesh.edges, Float32Array),
};
const places = unpacked(data.points.places, Float32Array), distances = unpacked(data.points.distances, Float32Array);
const unknown = "#b5b5b5";
let mode = "type", selected = -1;

function residualColour(value) { return value === null ? unknown : colourByStops(data.colours.residual, value); }

function colourOf(building) {
  return mode === "residual" ? residualColour(building.residual) : data.colours[mode][building[mode]] || unknown;
}

const light = lightOf(mesh.corners);

function meshColours() {
  const buildings = data.buildings.map(building => rgb(colourOf(building))), types = Object.values(data.colours.type).map(rgb);
  const wall = rgb(data.colours.wall), roof = t => mode === "type" ? types[mesh.roof[t] - 1] : buildings[mesh.owner[t]];
  return shadedColours(light, t => !mesh.roof[t] ? wall : mesh.owner[t] === selected ? [255, 45, 111] : roof(t));
}

const viewer = new Viewer(document.getElementById("scene"), mesh.corners, mesh.owner);
const solids = viewer.addLayer("TRIANGLES", mesh.corners, meshColours());
viewer.addLayer("LINES", mesh.edges, new Uint8Array(mesh.edges.length / 3 * 4).map((_, i) => i % 4 === 3 ? 255 : 60));
const cloudColours = new Uint8Array(4 * distances.length).fill(255);
distances.forEach((value, i) => cloudColours.set(rgb(residualColour(value)), 4 * i));
const cloud = viewer.addLayer("POINTS", places, cloudColours);
if (!viewer.gl) document.getElementById("hint").textContent = "This browser offers no WebGL, so there is no 3D view; the map shows all buildings.";

const map = document.getElementById("map"), svg = "http://www.w3.org/2000/svg";
const marks = data.buildings.map((building, index) => building.rings.length ? outlineOf(building, index) : buttonOf(building, index));

function outlineOf(building, index) {
  const path = document.createElementNS(svg, "path");
  path.setAttribute("d", building.rings.map(ring => "M" + ring.reduce((text, v, i) => text + (i % 2 ? -v + " " : v + ","), "") + "Z").join(""));
  path.append(document.createElementNS(svg, "title"));
  return mark(path, building, index, map);
}

function buttonOf(building, index) {
  const button = document.createElement("button");
  return mark(button, building, index, document.getElementById("unplaced"));
}

function mark(element, building, index, parent) {
  element.dataset.building = index;
  (element.querySelector("title") || element).textContent = `${building.id}: ${building.type}, ${building.outcome}`;
  element.addEventListener("click", () => { if (!dragged) select(index); });
  parent.append(element);
  return element;
}

// The map's window in scene metres, y down as SVG has it.
let dragged = false, view = [0, 0, 1, 1];
function fitMap() {
  const xs = [], ys = [];
  for (const b of data.buildings) for (const ring of b.rings) for (let i = 0; i < ring.length; i += 2) { xs.push(ring[i]); ys.push(-ring[i + 1]); }
  const least = list => list.reduce((a, b) => Math.min(a, b), Infinity), most = list => list.reduce((a, b) => Math.max(a, b), -Infinity);
  if (xs.length) view = [least(xs) - 5, least(ys) - 5, most(xs) - least(xs) + 10, most(ys) - least(ys) + 10];
  showMap();
}
function showMap() { map.setAttribute("viewBox", view.join(" ")); }
function mapScale() { return Math.max(view[2] / map.clientWidth, view[3] / map.clientHeight); }
map.addEventListener("wheel", event => {
  event.preventDefault();
  const k = Math.exp(event.deltaY * 0.001), s = mapScale(), box = map.getBoundingClientRect();
  const x = view[0] + view[2] / 2 + (event.clientX - box.left - box.width / 2) * s, y = view[1] + view[3] / 2 + (event.clientY - box.top - box.height / 2) * s;
  view = [x + (view[0] - x) * k, y + (view[1] - y) * k, view[2] * k, view[3] * k]; showMap();
}, { passive: false });
map.addEventListener("pointerdown", () => { dragged = false; });
map.addEventListener("pointermove", event => {
  if (!(event.buttons & 1)) return;
  if (Math.abs(event.movementX) + Math.abs(event.movementY) > 2) dragged = true;
  const s = mapScale(); view[0] -= event.movementX * s; view[1] -= event.movementY * s; showMap();
});

function recolour() {
  marks.forEach((element, i) => { if (element.tagName === "path") element.setAttribute("fill", colourOf(data.buildings[i])); });
  viewer.recolour(solids, meshColours());
  const entries = mode === "residual"
    ? data.colours.residual.map(([from, colour]) => [`from ${from} m`, colour]) : Object.entries(data.colours[mode]);
  const legend = document.getElementById("legend");
  legend.replaceChildren(...entries.map(([name, colour]) => {
    const item = document.createElement("span"), swatch = document.createElement("i");
    swatch.style.background = colour; item.append(swatch, name); return item;
  }));
}

function select(index) {
  if (selected >= 0) marks[selected].classList.remove("selected");
  selected = index;
  marks[index].classList.add("selected");
  const building = data.buildings[index], details = document.getElementById("details");
  const rows = [["id", building.id], ["type", building.type], ["outcome", building.outcome],
    ...Object.entries(building.measured), ...Object.entries(building.attributes)];
  const table = document.createElement("table");
  for (const [name, value] of rows) {
    const row = table.insertRow();
    row.insertCell().textContent = name; row.insertCell().textContent = String(value);
  }
  details.replaceChildren(table);
  viewer.recolour(solids, meshColours());
}

function approach(index) {
  let n = 0; const sum = [0, 0, 0];
  for (let t = 0; t < mesh.owner.length; t++) if (mesh.owner[t] === index) for (let k = 0; k < 9; k++) { sum[k % 3] += mesh.corners[9 * t + k]; n++; }
  if (n) viewer.lookAt(sum.map(v => 3 * v / n), 45);
}

viewer.onpick = select;
document.getElementById("mode").addEventListener("change", event => { mode = event.target.value; recolour(); });
document.getElementById("show-points").addEventListener("change", event => { cloud.visible = event.target.checked; viewer.draw(); });
document.getElementById("find").addEventListener("change", event => {
  const id = event.target.value.trim(), found = data.buildings.findIndex(building => building.id === id);
  if (found >= 0) { select(found); approach(found); }
  event.target.setCustomValidity(id && found < 0 ? "no building of this id" : ""); event.target.reportValidity();
});
for (const card of document.querySelectorAll("[data-select]")) card.addEventListener("click", () => {
  select(Number(card.dataset.select)); approach(Number(card.dataset.select)); scrollTo({ top: 0, behavior: "smooth" });
});
const unplaced = data.buildings.filter(building => !building.rings.length).length;
if (unplaced) document.getElementById("unplaced").prepend(`${unplaced} without a place on the map: `);
fitMap(); recolour(); viewer.draw();
