// One changed building at a time in 3D: both models and the points of both surveys, each of which can be hidden.

const compared = new Viewer(document.getElementById("compared"), new Float32Array(0), new Uint32Array(0));
const changeList = document.getElementById("changed"), PALER = 0.6;
const changeBoxes = [...document.querySelectorAll("[data-layer]")];

function plainColours(places, colour) {
  const colours = new Uint8Array(4 * places.length / 3).fill(255);
  for (let i = 0; i < colours.length; i += 4) colours.set(colour, i);
  return colours;
}

// The colours of one side: those of its points and of its model.
function colourSide(name) {
  const point = rgb(data.colours.surveys[name]);
  return { points: point, model: point.map(v => Math.round(v + PALER * (255 - v))) };
}

// Add the model and the points of one side; its layers by name.
function addSide(name, side) {
  const colours = colourSide(name);
  const [corners, edges, points] = ["corners", "edges", "points"].map(key => unpacked(side[key], Float32Array));
  return { corners, points, layers: {
    [`model ${name}`]: [
      compared.addLayer("TRIANGLES", corners, shadedColours(lightOf(corners), () => colours.model)),
      compared.addLayer("LINES", edges, plainColours(edges, [60, 60, 60]))],
    [`points ${name}`]: [compared.addLayer("POINTS", points, plainColours(points, colours.points))] } };
}

let comparedLayers = {};
function showLayers() {
  for (const box of changeBoxes) for (const layer of comparedLayers[box.dataset.layer]) layer.visible = box.checked;
  compared.draw();
}

function showChange(index) {
  const scene = data.changes[index];
  compared.clearLayers();
  const sides = ["before", "after"].map(name => addSide(name, scene[name]));
  comparedLayers = { ...sides[0].layers, ...sides[1].layers };
  const places = [...sides.flatMap(side => [side.corners, side.points])];
  compared.setMesh(Float32Array.from(places.flatMap(list => [...list])), new Uint32Array(0));
  // Walls of both models coincide, so the earlier one is shown at first only where there is no other.
  changeBoxes.find(box => box.dataset.layer === "model before").checked = !sides[1].corners.length;
  changeList.value = index;
  compared.home(); showLayers();
}

for (const box of changeBoxes) {
  const [what, name] = box.dataset.layer.split(" ");
  box.nextElementSibling.style.background = `rgb(${colourSide(name)[what]})`;
  box.addEventListener("change", showLayers);
}
changeList.addEventListener("change", () => showChange(Number(changeList.value)));
for (const button of document.querySelectorAll("[data-change]")) {
  button.addEventListener("click", () => {
    showChange(Number(button.dataset.change)); document.getElementById("comparison").scrollIntoView();
  });
}
showChange(0);
