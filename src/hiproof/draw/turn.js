function (name, model) {
  // Turns the view of a notebook: the same projection and painter's order as draw/view.py.
  const svg = document.getElementById(name);
  let turn = model.t[0], tilt = model.t[1], from = null;
  function show() {
    const a = turn * Math.PI / 180, t = tilt * Math.PI / 180;
    const page = model.v.map(([x, y, z]) => {
      const u = x * Math.cos(a) - y * Math.sin(a), w = x * Math.sin(a) + y * Math.cos(a);
      return [u * model.s, -(w * Math.sin(t) + z * Math.cos(t)) * model.s, z * Math.sin(t) - w * Math.cos(t)];
    });
    const seen = [];
    for (const face of model.f) {
      const ring = face.r[0];
      let area = 0, near = 0;
      ring.forEach((i, k) => {
        const p = page[i], q = page[ring[(k + 1) % ring.length]];
        area += p[0] * q[1] - q[0] * p[1];
        near += p[2] / ring.length;
      });
      if (area < 0) seen.push([near, face]);
    }
    seen.sort((one, other) => one[0] - other[0]);
    svg.innerHTML = seen.map(([, face]) => {
      const d = face.r.map(ring => "M" + ring.map(i => page[i][0].toFixed(1) + " " + page[i][1].toFixed(1)).join("L") + "Z").join("");
      return `<path d="${d}" fill="${face.c}" fill-rule="evenodd" stroke="#333" stroke-width="0.7"/>`;
    }).join("");
  }
  svg.onpointerdown = event => { from = [event.clientX, event.clientY]; svg.setPointerCapture(event.pointerId); };
  svg.onpointerup = () => { from = null; };
  function turnBy(right, down) {
    turn += right;
    tilt = Math.max(5, Math.min(90, tilt + down));
    show();
  }
  svg.onpointermove = event => {
    if (!from) return;
    turnBy((event.clientX - from[0]) * 0.6, (event.clientY - from[1]) * 0.4);
    from = [event.clientX, event.clientY];
  };
  svg.onkeydown = event => {
    const steps = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, -6], ArrowDown: [0, 6] };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    turnBy(...step);
  };
}
