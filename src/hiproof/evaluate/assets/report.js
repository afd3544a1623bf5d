// The page's behaviour: one selected building and one way of colouring, shown on the map, in 3D and in the panel.

const data = JSON.parse(document.getElementById("data").textContent);
const mesh = {
  corners: unpacked(data.mesh.corners, Float32Array), owner: unpacked(data.mesh.owner, Uint32Array),
  roof: unpacked(data.mesh.roof, Uint8Array), sun: unpacked(data.mesh.sun, Float32Array), edges: unpacked(data.mesh.edges, Float32Array),
};
const places = unpacked(data.points.places, Float32Array), distances = unpacked(data.points.distances, Float32Array);
let mode = "type", selected = -1;

function residualColour(value) {
  return value === null ? data.colours.unknown : colourByStops(data.colours.residual, value);
}

function sunColour(value) {
  return value === null || value < 0 ? data.colours.unknown : colourByStops(data.colours.sun, value);
}

function colourOf(building) {
  if (mode === "sun") return sunColour(building.sun);
  if (mode === "residual") return residualColour(building.residual);
  if (mode === "type") return typeColour(data.colours, building.type);
  return data.colours[mode][building[mode]] || data.colours.unknown;
}

const light = lightOf(mesh.corners);

function meshColours() {
  const buildings = data.buildings.map(building => rgb(colourOf(building)));
  const types = data.types.map(type => rgb(typeColour(data.colours, type)));
  const wall = rgb(data.colours.wall), mark = rgb(data.colours.mark);
  const roof = t => mode === "type" ? types[mesh.roof[t] - 1] : mode === "sun" ? rgb(sunColour(mesh.sun[t])) : buildings[mesh.owner[t]];
  const isPlain = t => !mesh.roof[t] && !(mode === "sun" && mesh.sun[t] >= 0);
  const colourAt = t => isPlain(t) ? wall : mesh.owner[t] === selected ? mark : roof(t);
  return shadedColours(light, colourAt);
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
  (element.querySelector("title") || element).textContent = `${building.id}: ${typeWords(data.colours, building.type)}, ${building.outcome}`;
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
// Zoom about a place of the map, in pixels from its middle.
function zoomMap(k, right = 0, down = 0) {
  const s = mapScale(), x = view[0] + view[2] / 2 + right * s, y = view[1] + view[3] / 2 + down * s;
  view = [x + (view[0] - x) * k, y + (view[1] - y) * k, view[2] * k, view[3] * k]; showMap();
}
map.addEventListener("wheel", event => {
  event.preventDefault();
  const { left, top, width, height } = map.getBoundingClientRect();
  const right = event.clientX - left - width / 2, down = event.clientY - top - height / 2;
  zoomMap(Math.exp(event.deltaY * 0.001), right, down);
}, { passive: false });
map.addEventListener("keydown", event => {
  const count = data.buildings.length, step = ARROWS[event.key]?.reduce((a, b) => a + b);
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (step && count) show((Math.max(selected, step < 0 ? 0 : -1) + step + count) % count);
  else if (event.key === "+" || event.key === "=") zoomMap(1 / ZOOM_STEP);
  else if (event.key === "-") zoomMap(ZOOM_STEP);
  else if (event.key === "Home") fitMap();
  else return;
  event.preventDefault();
});
map.addEventListener("pointerdown", () => { dragged = false; });
map.addEventListener("pointermove", event => {
  if (!(event.buttons & 1)) return;
  if (Math.abs(event.movementX) + Math.abs(event.movementY) > 2) dragged = true;
  const s = mapScale(); view[0] -= event.movementX * s; view[1] -= event.movementY * s; showMap();
});

function recolour() {
  marks.forEach((element, i) => { if (element.tagName === "path") element.setAttribute("fill", colourOf(data.buildings[i])); });
  viewer.recolour(solids, meshColours());
  showLegend(entries());
}

// What the legend lists: colours that some building has.
function entries() {
  const { colours, types, buildings } = data;
  if (mode === "residual") {
    return colours.residual.map(([from, colour]) => [`from ${from} m`, colour]);
  }
  if (mode === "sun") {
    const sky = buildings.map(building => building.attributes.hiproof_sun_sky).find(Boolean);
    return colours.sun.map(([from, colour]) => [`from ${from} kWh/m²${sky ? ` (${sky})` : ""}`, colour]);
  }
  const names = mode === "type" ? types.map(type => entryOf(colours, type))
    : buildings.map(building => building[mode]);
  return Object.entries(colours[mode]).filter(([name]) => names.includes(name));
}

function select(index) {
  if (selected >= 0) marks[selected].classList.remove("selected");
  selected = index;
  marks[index].classList.add("selected");
  const building = data.buildings[index], details = document.getElementById("details");
  const rows = [["id", building.id], ["type", typeWords(data.colours, building.type)], ["outcome", building.outcome],
    ...Object.entries(building.measured), ...Object.entries(building.attributes)];
  const table = document.createElement("table");
  table.append(...rows.map(([name, value]) => headedRow(name, String(value))));
  details.replaceChildren(table);
  viewer.recolour(solids, meshColours());
}

// Show a building from where all of it is seen.
function show(index) {
  select(index);
  const corners = mesh.corners.filter((_, i) => mesh.owner[Math.floor(i / 9)] === index);
  if (corners.length) viewer.frame(sphereOf(corners));
}

viewer.onpick = select;
// Only a run of `hiproof enrich --sun` has the sun.
if (mesh.sun.length) document.getElementById("mode").append(new Option("sun on roofs", "sun"));
// Only a run of `hiproof update` has changes.
if (data.buildings.some(building => building.change)) document.getElementById("mode").append(new Option("change", "change"));
document.getElementById("mode").addEventListener("change", event => { mode = event.target.value; recolour(); });
document.getElementById("show-points").addEventListener("change", event => { cloud.visible = event.target.checked; viewer.draw(); });
document.getElementById("find").addEventListener("change", event => {
  const id = event.target.value.trim(), found = data.buildings.findIndex(building => building.id === id);
  if (found >= 0) show(found);
  event.target.setCustomValidity(id && found < 0 ? "no building of this id" : ""); event.target.reportValidity();
});
for (const button of document.querySelectorAll("[data-select]")) {
  button.addEventListener("click", () => {
    show(Number(button.dataset.select)); scrollTo({ top: 0, behavior: "smooth" });
  });
}
const unplaced = data.buildings.filter(building => !building.rings.length).length;
if (unplaced) document.getElementById("unplaced").prepend(`${unplaced} without a place on the map: `);
showMark(data.colours); fitMap(); recolour(); viewer.draw();
