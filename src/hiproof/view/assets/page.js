// The page: what lies under a click, and which roof types are in view.

const colours = JSON.parse(document.getElementById("colours").textContent);
const types = new Map();  // the number of parts by entry of the legend
const hint = document.getElementById("hint");
let scene = null;

function show(found) {
  const rows = found ? found.tile.table.row(found.row).filter(({ value }) => value !== null && value !== "") : [];
  const lines = rows.flatMap(row => partsOf(row)?.map((part, number) => lineOf(part, number, row.told)) || [row]);
  document.getElementById("details").replaceChildren(...lines.map(line));
  hint.hidden = rows.length > 0;
  scene.select(found);
}

function line({ name, told, value }) {
  return Object.assign(headedRow(name, value), { title: told });
}

// The parts of a roof that a row tells of; null where it tells of something else, as the input's own of that name does.
function partsOf({ name, value }) {
  try {
    const { parts } = name === "parameters" ? JSON.parse(value) : {};
    return parts.every(({ type, parameters }) => type && parameters) ? parts : null;
  } catch { return null; }
}

function lineOf({ type, parameters }, number, told) {
  const named = Object.entries(parameters).map(([name, size]) => `${name} ${Math.round(100 * size) / 100}`);
  return { name: `part ${number}`, told, value: `${typeWords(colours, type)}: ${named.join(", ")}` };
}

function fail(sentence) { hint.textContent = sentence; hint.hidden = false; }

let sky = "";
const changes = new Set(["unchanged"]);  // classes of buildings in view
const MODES = { sun: "sun on roofs", change: "change" };  // beside the roof type

// What a row tells beside the type: the irradiation of its roof in a year (kWh/m2) where `hiproof enrich --sun` ran,
// and its class in an update; null where unknown.
function toldOf(tile, row) {
  tile.told ||= [];
  if (tile.told[row] === undefined) {
    const values = Object.fromEntries(tile.table.row(row).map(({ name, value }) => [name, value]));
    const area = values.hiproof_flat_roof_area_m2 + values.hiproof_sloped_roof_area_m2;
    sky = values.hiproof_sun_sky || sky;
    const sun = values.hiproof_roof_sun_kwh > 0 && area > 0 ? values.hiproof_roof_sun_kwh / area : null;
    tile.told[row] = { sun, change: values.hiproof_change || null };
  }
  return tile.told[row];
}

const colourBy = {
  sun: ({ sun }) => sun === null ? colours.unknown : colourByStops(colours.sun, sun),
  change: ({ change }) => colours.change[change || "unchanged"],
};

function colourRoofs() {
  const mode = document.getElementById("mode").value, colour = colourBy[mode];
  scene.recolourRoofs(colour ? (tile, row) => rgb(colour(toldOf(tile, row))) : null);
  if (mode === "sun") showLegend(colours.sun.map(([from, colour]) => [`from ${from} kWh/m²${sky ? ` (${sky})` : ""}`, colour]));
  else if (mode === "change") showLegend(Object.entries(colours.change).filter(([name]) => changes.has(name)));
  else showTypes();
}

// Offer the modes that a row tells of.
function offer(told) {
  if (told.change) changes.add(told.change);
  const select = document.getElementById("mode"), offered = Array.from(select.options, option => option.value);
  for (const name in MODES) if (told[name] !== null && !offered.includes(name)) select.append(new Option(MODES[name], name));
  document.getElementById("colour-by").hidden = select.options.length === 1;
}

function legend(tile) {
  for (let row = 0; row < tile.table.count; row++) {
    offer(toldOf(tile, row));
    const told = tile.table.row(row), whole = [{ type: told.find(({ name }) => name === "type").value }];
    for (const { type } of told.map(partsOf).find(Boolean) || whole) {
      const entry = entryOf(colours, type);
      types.set(entry, (types.get(entry) || 0) + 1);
    }
  }
  if (document.getElementById("mode").value === "type") showTypes();
}

function showTypes() {
  showLegend([...types].sort((a, b) => b[1] - a[1]).map(([entry]) => [entry, colours.type[entry]]));
}

async function begin() {
  const answer = await fetch("tileset.json").catch(() => null), tileset = answer?.ok ? await answer.json().catch(() => null) : null;
  if (!tileset?.root) return fail("The tiles cannot be read: is hiproof view still running, and the folder still there?");
  scene = new TileScene(document.getElementById("scene"), tileset, "", rgb(colours.mark));
  if (!scene.gl) return fail("This browser offers no WebGL, so there is no 3D view.");
  scene.onload = legend;
  scene.onfail = reason => fail(`Some tiles cannot be read (${reason}); load the page again, or make them anew.`);
  scene.onpick = show;
  document.getElementById("mode").addEventListener("change", colourRoofs);
  document.addEventListener("keydown", event => {
    if (event.key === "Home") scene.home();
    if (event.key === "Escape") show(null);
  });
  scene.draw();
}

const ready = begin();
