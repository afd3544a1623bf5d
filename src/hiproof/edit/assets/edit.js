"use strict";
// The page's behaviour. The server keeps no drafts: every edit sends the parts it starts from, and the page keeps what came
// before for undo. Edits go one after the other, in the order of keys and clicks.

const $ = id => document.getElementById(id);
let start = { types: [], colours: {} };
let rows = [], drafts = new Map(), now = null, clicked = null, merging = false, queue = Promise.resolve();

class Refused extends Error { constructor(answer, code) { super(answer.error || `the server answered ${code}`); this.answer = answer; this.code = code; } }

async function answered(request) {
  const response = await request.catch(() => { throw new Refused({ error: "the server does not answer; is `hiproof edit` still running? Nothing here is lost" }, 0); });
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Refused(answer, response.status);
  return answer;
}
const ask = (name, query = {}) => answered(fetch(`${name}?${new URLSearchParams(query)}`));
const tell = (name, body) => answered(fetch(name, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ id: now.id, ...body }) }));

function say(text, wrong = false) { $("say").textContent = text; $("say").classList.toggle("wrong", wrong); }

// What is done waits for what was asked before; a refusal becomes a sentence, and a fault of this script stops nothing that follows.
function inTurn(action) {
  queue = queue.then(action).catch(error => { say(error.message, true); if (!(error instanceof Refused)) reportError(error); });
  return queue;
}

// ---- the list

async function list() {
  const found = await ask("buildings", { find: $("find").value.trim() });
  rows = found.rows;
  const listed = found.found > rows.length ? `, ${rows.length} of ${found.found} listed` : "";
  $("count").textContent = `${found.all}, ${found.accepted} accepted${listed}`;
  if (!rows.length) say(found.all ? "no building whose id holds this" : "the run has no buildings");
  showList();
}

function showList() {
  keepFocus(() => $("list").replaceChildren(...rows.map(row => {
    const item = document.createElement("li"), button = document.createElement("button");
    row.item = item; row.button = button;
    row.tag = element("span", "tag");
    const name = element("span", "name", `${plainly(row.id)} ${wordsOf(row.type)}`);
    button.append(name, row.tag, element("small", "", reasonOf(row)));
    button.dataset.open = row.id;
    button.addEventListener("click", () => inTurn(() => open(row.id)));
    item.dataset.id = row.id; item.append(button);
    mark(row);
    return item;
  })));
  seeCurrent();
}

const wordsOf = type => type ? typeWords(start.colours, type) : "no model";
const reasonOf = row => row.reasons.join(", ")
  || (row.share === null ? "no points" : `${Math.round(100 * row.share)} % within 0.2 m`);
const element = (name, className, textContent = "") =>
  Object.assign(document.createElement(name), { className, textContent });

// Run `rebuild`, which replaces controls, and give the focus back to the control that had it.
function keepFocus(rebuild) {
  const { id, dataset } = document.activeElement, [name] = Object.keys(dataset);
  rebuild();
  if (document.activeElement !== document.body || !(id || name)) return;
  const same = `[data-${name}="${CSS.escape(dataset[name])}"]`;
  (id ? $(id) : document.querySelector(same))?.focus({ preventScroll: true });
}

// What is said of a building by its row: whether it is shown, changed or accepted.
function mark(row) {
  const isCurrent = Boolean(now && row.id === now.id), isDraft = drafts.get(row.id)?.dirty;
  const state = isDraft ? "draft" : row.is_accepted ? "accepted" : "";
  row.item.className = [isCurrent ? "current" : "", state].join(" ");
  row.button.setAttribute("aria-current", isCurrent);
  row.tag.textContent = isDraft ? "changed" : state;
  row.tag.hidden = !row.tag.textContent;
}
const markCurrent = () => rows.filter(row => row.id === now.id).forEach(mark);

// Scroll the list to its current row. `scrollIntoView` would also move where the Tab key begins.
const seeCurrent = () => {
  const [list, row] = [$("list"), $("list").querySelector(".current")];
  if (!row) return;
  const [outer, inner] = [list.getBoundingClientRect(), row.getBoundingClientRect()];
  list.scrollTop += Math.min(inner.top - outer.top, 0) + Math.max(inner.bottom - outer.bottom, 0);
};

// The next building that is not accepted yet, or the one before, whatever it is.
function step(by) {
  const here = rows.findIndex(row => now && row.id === now.id);
  for (let i = here + by; i >= 0 && i < rows.length; i += by) if (by < 0 || !rows[i].is_accepted) return open(rows[i].id);
  say(by > 0 ? "no further building in the list waits" : "this is the first of the list");
}

// ---- one building

async function open(id) {
  const found = await ask("building", { id }), known = drafts.get(id);
  const isKnown = known && known.version === found.version && known.dirty;
  now = isKnown ? known : { id, version: found.version, accepted: found.accepted, model: found, first: found.figures, ground: found.said.z_ground, left: Boolean(found.said.leave_out), history: [], dirty: false, held: {}, part: 0, cloud: null };
  drafts.set(id, now);
  now.reasons = found.reasons; now.outcome = found.outcome;
  clicked = null; merging = false; say(found.error || "", Boolean(found.error)); $("note").value = ""; $("tried").replaceChildren();
  if (!isKnown) now.part = largest(found.handles || []);
  show(now.model, true);
  rows.forEach(mark); seeCurrent();
  if (!now.model.mesh) return;
  now.cloud = await ask("points", { id });
  if (now.cloud.missing) say(now.cloud.missing);
  if (now.cloud.count) { const model = await changed(now.model.parts, { action: "show" }); now.first = isKnown ? now.first : model.figures; show(model); }
}

// The model of `parts` after an edit, over the ground as it is said to be.
const changed = (parts, asked, more = {}) => tell("change", { parts, asked, z_ground: now.ground, ...more });

function largest(handles) {
  const areas = handles.map(h => (h.width || 0) * (h.length || 0));
  return Math.max(areas.indexOf(Math.max(...areas)), 0);
}

function show(model, home = false) {
  now.model = model;
  now.part = Math.min(now.part, Math.max((model.parts || []).length - 1, 0));
  $("title").textContent = `${plainly(now.id)}: ${wordsOf(model.type)}`;
  $("reasons").textContent = [...now.reasons, now.outcome].filter(Boolean).join("; ");
  const accepted = now.accepted;
  $("accepted").textContent = accepted ? `accepted by ${accepted.who || "somebody"}, ${accepted.when || "some time ago"}${accepted.note ? `: ${accepted.note}` : ""} ` : "";
  if (accepted) $("accepted").append(takeBack());
  draw(home);
  showWhole();
  showParts();
  showFigures();
}

// What is said of the building as a whole: the height of its ground, and whether it is left out.
function showWhole() {
  const height = now.ground ?? now.model.figures?.z_ground;
  $("ground").value = height ?? ""; $("ground").disabled = !now.model.mesh || now.left;
  $("leave-out").textContent = now.left ? "keep in" : "leave out";
  if (now.left) $("title").textContent = `${plainly(now.id)}: left out`;
}

const FIGURES = [["share_within_20cm", "points within 0.2 m of the roof", v => `${(100 * v).toFixed(1)} %`], ["unexplained_area_m2", "area of points over 0.5 m off the roof", v => `${v.toFixed(0)} m²`],
  ["rmse", "RMSE", v => `${v.toFixed(3)} m`], ["volume_m3", "volume", v => `${v.toFixed(0)} m³`], ["ridge_height", "highest ridge", v => `${v.toFixed(2)} m`], ["points", "points", v => v]];

function showFigures() {
  $("figures").replaceChildren();
  for (const [name, title, text] of FIGURES) {
    const value = now.model.figures?.[name], was = now.first?.[name];
    if (value === null || value === undefined) continue;
    const isNew = was !== null && was !== undefined && was !== value;
    const row = headedRow(title, text(value), isNew ? `was ${text(was)}` : "");
    Object.assign(row.cells[1].dataset, { figure: name, value });
    $("figures").append(row);
  }
}

// ---- the view

const FADED = 0.45;  // of the colour of parts that are not chosen
const viewer = new Viewer($("scene"), new Float32Array(0), new Int32Array(0));
const handles = new Handles(viewer, $("handles"));
if (!viewer.gl) say("this browser offers no WebGL, so there is no 3D view; numbers and keys work");

function draw(home) {
  viewer.clearLayers();
  const mesh = now.model.mesh;
  if (!mesh || now.left) { viewer.setMesh(new Float32Array(0), new Int32Array(0)); handles.show([]); drawCloud(); viewer.draw(); return; }
  const corners = unpacked(mesh.corners, Float32Array), owner = unpacked(mesh.part, Int32Array), edges = unpacked(mesh.edges, Float32Array);
  viewer.setMesh(corners, owner);
  const colours = now.model.parts.map(part => rgb(typeColour(start.colours, part.type)));
  const faded = colours.map(colour => colour.map(part => 255 - FADED * (255 - part)));
  const wall = rgb(start.colours.wall);
  const colourAt = t => (owner[t] === now.part ? colours : faded)[owner[t]] || wall;
  if ($("show-roof").checked) viewer.addLayer("TRIANGLES", corners, shadedColours(lightOf(corners), colourAt));
  viewer.addLayer("LINES", edges, new Uint8Array(edges.length / 3 * 4).map((_, i) => i % 4 === 3 ? 255 : 60));
  drawCloud();
  if (home) viewer.home();
  handles.show(handlesOf(now.model.handles[now.part], now.model.parts[now.part], now.model.origin[2]));
  viewer.draw();
}

function drawCloud() {
  const gaps = now.model.gaps ? unpacked(now.model.gaps, Float32Array) : [];
  if (!now.cloud?.places || !$("show-points").checked) return;
  const places = unpacked(now.cloud.places, Float32Array), colours = new Uint8Array(places.length / 3 * 4).fill(255);
  const stops = start.colours.residual;
  gaps.forEach((gap, i) => colours.set(rgb(colourByStops(stops, Math.abs(gap))), 4 * i));
  viewer.addLayer("POINTS", places, colours);
}

viewer.onpick = (owner, x, y) => { if (owner < 0) return; clicked = viewer.placeUnder(x, y); if (merging) return inTurn(() => mergeWith(owner)); choose(owner); };

function choose(index) { now.part = index; draw(false); showParts(); }

// While a hand drags, only the newest place counts; the edit stands when the hand lets go.
let drag = null;
handles.ondrag = (handle, change) => {
  drag ??= { before: snapshot(), parts: now.model.parts, busy: false, wanted: null, change: null };
  drag.wanted = change;
  if (!drag.busy) follow(drag, handle);
};
async function follow(drag, handle) {
  drag.busy = true;
  while (drag.wanted) {
    const change = drag.wanted; drag.wanted = null;
    try {
      show(await changed(drag.parts, { action: "change", part: now.part, change }, { dragged: true }));
      drag.change = change; say("");
    } catch (error) { say(error.message, true); }
  }
  drag.busy = false;
  drag.idle?.();
}
handles.ondrop = handle => inTurn(async () => {
  const done = drag; drag = null;
  if (!done) return;
  if (done.busy) await new Promise(resolve => { done.idle = resolve; });
  if (!done.change) return;
  const model = await changed(done.parts, { action: "change", part: now.part, change: done.change });
  now.history.push(done.before); now.dirty = true;
  if (handle.name === "ridge" || handle.name === "eave") pin(now.part, heightsOf(now.model.parts[now.part]));
  show(model); markCurrent();
});

// ---- edits

function snapshot() { return { model: now.model, held: structuredClone(now.held), part: now.part, ground: now.ground, left: now.left, dirty: now.dirty }; }

async function edit(asked, after = () => {}) {
  if (!now.model.parts?.length) return say("this building has no parts to change");
  if (now.left) return say("this building is left out; keep it in first");
  const before = snapshot(), began = performance.now(), model = await changed(now.model.parts, asked);
  now.history.push(before); now.dirty = true; after(); say(""); show(model); markCurrent();
  $("say").dataset.ms = (performance.now() - began).toFixed(1);
}

const heightsOf = part => ["z", ...Object.keys(part.parameters).filter(name => /^(pitch_|eave_)|height$/.test(name))];
function pin(index, names) { now.held[index] = [...new Set([...(now.held[index] || []), ...names])]; }
function unpin(index, name) { now.held[index] = (now.held[index] || []).filter(held => held !== name); }
const changePart = (change, names) => inTurn(() => edit({ action: "change", part: now.part, change }, () => pin(now.part, names)));
const setType = type => inTurn(() => edit({ action: "change", part: now.part, change: { type } }, () => { delete now.held[now.part]; }));
const forgetPins = () => { now.held = {}; };
const refit = () => inTurn(() => {
  if (!now.cloud?.count) return say(now.cloud?.missing || "no points to refit to", true);
  return edit({ action: "refit", held: now.held });
});
const split = side => inTurn(() => edit({ action: "split", part: now.part, side }, forgetPins));
const remove = () => inTurn(() => edit({ action: "remove", part: now.part }, forgetPins));
const added = action => () => inTurn(async () => {
  const before = now.model;
  await edit({ action, part: now.part, place: clicked });
  if (now.model !== before) { now.part = now.model.parts.length - 1; show(now.model); }
});
const dormer = added("dormer"), recess = added("recess");

function merge() {
  const count = now.model.parts?.length || 0;
  if (count < 2) return say("this building has no other part to merge with");
  if (count === 2) return inTurn(() => mergeWith(1 - now.part));
  merging = true; say("choose the part to merge with");
}
async function mergeWith(other) {
  merging = false;
  if (other < 0 || other === now.part) return say("choose another part");
  const kept = now.part - (other < now.part ? 1 : 0);
  await edit({ action: "merge", part: now.part, other }, forgetPins);
  now.part = kept; show(now.model);
}

const undo = () => inTurn(() => {
  const { model, ...before } = now.history.pop() || {};
  if (!model) return say("nothing to undo");
  Object.assign(now, before); say(""); show(model); markCurrent();
});

const setGround = height => inTurn(async () => {
  const before = snapshot();
  now.ground = height;
  try {
    const model = await changed(now.model.parts, { action: "show" });
    now.history.push(before); now.dirty = true; say(""); show(model); markCurrent();
  } catch (error) { now.ground = before.ground; show(now.model); throw error; }
});

const leaveOut = () => inTurn(() => {
  now.history.push(snapshot()); now.left = !now.left; now.dirty = true;
  say(now.left ? "left out: once accepted, the next run makes no model of it" : ""); show(now.model); markCurrent();
});

async function tryTypes() {
  if (!now.cloud?.count) return say(now.cloud?.missing || "no points to try types on", true);
  say("trying every type ...");
  const { types } = await tell("alternatives", { parts: now.model.parts, part: now.part, z_ground: now.ground });
  say("");
  $("tried").replaceChildren(...types.map(row => {
    const button = document.createElement("button");
    button.textContent = `${wordsOf(row.type)} ${row.share === null ? "" : (100 * row.share).toFixed(1) + "\u00a0%"}`;
    button.dataset.try = row.type;
    button.addEventListener("click", () => { setType(row.type); refit(); });
    return button;
  }));
}

async function accept(version = now.version) {
  if (!now.model.parts?.length && !now.left) return say("this building has no parts to accept");
  const said = now.left ? { leave_out: true } : { parts: now.model.parts, z_ground: now.ground };
  try {
    const answer = await tell("accept", { ...said, version, note: $("note").value });
    now.version = answer.version; now.accepted = { who: start.who, when: answer.when, note: $("note").value }; now.dirty = false;
    for (const before of now.history) before.dirty = true;
    say("accepted");
  } catch (error) {
    if (error.code !== 409) throw error;
    return conflict(error);
  }
  await list(); show(now.model);
}

// A button that takes an accepted edit back: the building is the run's again.
function takeBack() {
  const button = document.createElement("button");
  button.id = "withdraw"; button.textContent = "take back";
  button.addEventListener("click", () => inTurn(async () => {
    await tell("withdraw", { version: now.version });
    now.dirty = false; drafts.delete(now.id); await list(); await open(now.id); say("taken back");
  }));
  return button;
}

// Another window was faster: the person decides.
function conflict(error) {
  say(error.message + " ", true);
  const choices = [["look at theirs", "theirs", () => { now.dirty = false; return open(now.id); }], ["accept mine all the same", "mine", () => accept(error.answer.version)]];
  for (const [text, id, action] of choices) {
    const button = document.createElement("button");
    button.textContent = text; button.id = id; button.addEventListener("click", () => inTurn(action));
    $("say").append(button);
  }
}

// ---- the panel

function showParts() {
  const parts = now.model.parts || [];
  keepFocus(() => {
    $("parts").replaceChildren(...parts.map((part, index) => {
      const row = element("button", `part${index === now.part ? " current" : ""}`);
      const swatch = document.createElement("i");
      swatch.style.background = typeColour(start.colours, part.type);
      row.dataset.part = index; row.setAttribute("aria-current", index === now.part);
      row.append(swatch, `${index} ${wordsOf(part.type)}`);
      row.addEventListener("click", () => {
        clicked = null;
        if (merging) inTurn(() => mergeWith(index)); else choose(index);
      });
      return row;
    }));
    showNumbers(parts[now.part], now.model.handles?.[now.part]);
  });
}

function showNumbers(part, handle) {
  $("numbers").replaceChildren(); $("part-title").textContent = `Part ${now.part}`;
  $("drawing").hidden = $("part-title").hidden = !part;
  if (!part) return;
  if ($("drawing").dataset.type !== part.type) { $("drawing").dataset.type = part.type; $("drawing").src = `drawing?${new URLSearchParams({ type: part.type })}`; $("drawing").alt = `a ${part.type} roof with its parameters`; }
  const select = document.createElement("select");
  select.id = "type"; select.append(...start.types.map(type => new Option(wordsOf(type), type, false, type === part.type)));
  leaveUnlessStepped(select, () => true);
  select.addEventListener("change", () => setType(select.value));
  numberRow("type", select);
  const z = now.model.origin[2], sigma = part.sigma || {};
  if (handle?.place) {
    numberRow("ridge", input("ridge_height", z + handle.ridge, value => changePart({ ridge_height: value }, heightsOf(part))), "m");
    numberRow("eave", input("eave_height", z + handle.eave, value => changePart({ eave_height: value, ...(handle.ridge > handle.eave ? { ridge_height: z + handle.ridge } : {}) }, heightsOf(part))), "m", sigma.t_z, "z");
  }
  for (const [name, value] of Object.entries(part.parameters)) numberRow(name, input(name, value, v => changePart({ [name]: v }, [name])), unitOf(name), sigma[name], /^(width|length|teeth|facing_.*|distance_.*)$/.test(name) ? null : name);
  const [x, y] = part.position;
  numberRow("x", input("x", x, v => changePart({ position: [v, y, part.position[2]] }, [])), "m", sigma.t_x);
  numberRow("y", input("y", y, v => changePart({ position: [x, v, part.position[2]] }, [])), "m", sigma.t_y);
  numberRow("rotation", input("rotation", part.rotation || 0, v => changePart({ rotation: v }, [])), "°", sigma.rotation);
}

const unitOf = name => /^(pitch|skew|facing)_/.test(name) ? "°" : name === "teeth" ? "" : "m";

function input(name, value, changed) {
  const field = document.createElement("input");
  field.type = "number"; field.step = "any"; field.value = Number(value.toFixed(3)); field.dataset.name = name;
  leaveUnlessStepped(field);
  field.addEventListener("change", () => { const number = field.valueAsNumber; if (Number.isFinite(number)) changed(number); else show(now.model); });
  return field;
}

// After the mouse or Enter, letters are shortcuts again. Keys that step to another value keep the focus: more may follow.
function leaveUnlessStepped(field, isStep = key => key.startsWith("Arrow")) {
  let isStepped = false;
  field.addEventListener("keydown", ({ key }) => { isStepped = isStep(key); });
  field.addEventListener("pointerdown", () => { isStepped = false; });
  field.addEventListener("change", () => { if (!isStepped) field.blur(); });
}

// A row: name, field, unit, standard deviation, and a pin where a refit may change the number.
function numberRow(title, field, unit = "", sigma = undefined, pinned = null) {
  const row = headedRow(title, "", unit, sigma === undefined ? "" : `± ${sigma.toFixed(3)}`, "");
  field.setAttribute("aria-label", title);
  row.cells[1].append(field); $("numbers").append(row);
  if (!pinned) return;
  const label = document.createElement("label"), box = document.createElement("input"), index = now.part;
  box.type = "checkbox"; box.checked = (now.held[index] || []).includes(pinned); box.dataset.pin = pinned;
  box.setAttribute("aria-label", `pin ${title}`);
  box.addEventListener("change", () => {
    if (box.checked) pin(index, [pinned]); else unpin(index, pinned);
  });
  label.title = "a refit keeps it"; label.append(box, "pin"); row.cells[4].append(label);
}

// ---- clicks and keys

const next = () => inTurn(() => step(1)), previous = () => inTurn(() => step(-1)), acceptNow = () => inTurn(() => accept());
const tryNow = () => inTurn(tryTypes), across = () => split("length"), along = () => split("width"), leave = () => { merging = false; say(""); };
const BUTTONS = { next, previous, refit, undo, accept: acceptNow, split: across, "split-width": along, merge, dormer, recess, remove, try: tryNow, "leave-out": leaveOut };
const KEYS = { n: next, p: previous, r: refit, u: undo, a: acceptNow, s: across, m: merge, d: dormer, e: recess, Delete: remove, t: tryNow, o: leaveOut, Escape: leave };
const act = action => now || action === next || action === previous ? action() : say("no building is chosen");
for (const [id, action] of Object.entries(BUTTONS)) {
  $(id).addEventListener("click", () => act(action));
}
leaveUnlessStepped($("ground"));
$("ground").addEventListener("change", event => { const height = event.target.valueAsNumber; if (Number.isFinite(height)) setGround(height); else showWhole(); });
const isTyping = ({ tagName, type }) =>
  tagName === "SELECT" || (tagName === "INPUT" && type !== "checkbox");
document.addEventListener("keydown", event => {
  if ((event.ctrlKey || event.metaKey) && event.key === "z") { event.preventDefault(); act(undo); return; }
  if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) {
    const isDone = event.key === "Escape" || (event.key === "Enter" && event.target.id === "note");
    if (isDone) event.target.blur();
    return;
  }
  if (!$("letter-keys").checked) return;
  if (/^[1-9]$/.test(event.key) && now?.model.parts?.length >= Number(event.key)) choose(Number(event.key) - 1);
  else if (KEYS[event.key]) { event.preventDefault(); act(KEYS[event.key]); }
});
$("find").addEventListener("change", () => inTurn(list));
for (const id of ["show-points", "show-roof"]) $(id).addEventListener("change", () => { if (now) draw(false); });
addEventListener("beforeunload", event => { if ([...drafts.values()].some(draft => draft.dirty)) event.preventDefault(); });

inTurn(async () => {
  start = await ask("start");
  showMark(start.colours);
  await list();
  if (rows.length) await open(rows[0].id);
  if (start.missing) say(start.missing);
});
