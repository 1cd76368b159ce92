// Orbits of the shaft: equal axes, the ring that the shaft may not touch, zones, the last turns and where it is now.

const MARGIN = 1.12; // of what has to fit

/** The half side of the picture in m, and a round scale bar for it. */
export function scaleOf(orbit, x, y, zoom) {
  let reach = 0;
  for (let k = 0; k < x.length; k++) reach = Math.max(reach, Math.abs(x[k]), Math.abs(y[k]));
  const outer = Math.max(orbit.clearance_m || 0, ...orbit.zones.map((z) => z.radius_m), 0);
  const half = MARGIN * (zoom || !outer ? Math.max(reach, 1e-7) : Math.max(outer, reach));
  const bar = 10 ** Math.floor(Math.log10(half));
  return { half, bar: bar * (half / bar >= 5 ? 2 : half / bar >= 2 ? 1 : 0.5) };
}

function circle(ctx, centre, radius) {
  ctx.beginPath();
  ctx.arc(centre, centre, radius, 0, 2 * Math.PI);
  ctx.stroke();
}

function drawZones(ctx, side, orbit, scale, palette) {
  const centre = side / 2;
  ctx.fillStyle = ctx.strokeStyle = palette.zone;
  ctx.font = "10px system-ui, sans-serif";
  ctx.textAlign = "center";
  ctx.lineWidth = 1;
  const radii = [0, ...orbit.zones.map((z) => z.radius_m)];
  const letters = orbit.zones.length ? [...orbit.zones.map((z) => z.name.split("/")[0]), orbit.zones.at(-1).name.split("/")[1] || ""] : [];
  ctx.setLineDash([3, 3]);
  for (const radius of radii.slice(1)) circle(ctx, centre, radius * scale);
  ctx.setLineDash([]);
  letters.forEach((letter, k) => {
    const outer = radii[k + 1] ?? Math.max(radii[k] * 1.1, orbit.clearance_m || 0);
    const at = (radii[k] + outer) / 2 * scale;
    if ((outer - radii[k]) * scale > 9 && at < centre - 6) ctx.fillText(letter, centre + at * Math.SQRT1_2, centre - at * Math.SQRT1_2 + 4);
  });
}

function drawAxes(ctx, side, orbit, palette, bar, scale) {
  const centre = side / 2;
  ctx.strokeStyle = palette.grid;
  ctx.lineWidth = 1;
  ctx.beginPath();
  ctx.moveTo(centre, 0);
  ctx.lineTo(centre, side);
  ctx.moveTo(0, centre);
  ctx.lineTo(side, centre);
  ctx.stroke();
  ctx.fillStyle = ctx.strokeStyle = palette.ink;
  ctx.font = "11px system-ui, sans-serif";
  const label = (text, x, y) => { // on the paper, over whatever circle passes there
    ctx.save();
    ctx.lineWidth = 4;
    ctx.strokeStyle = palette.paper;
    ctx.strokeText(text, x, y);
    ctx.restore();
    ctx.fillText(text, x, y);
  };
  ctx.textAlign = "right";
  label(orbit.x, side - 3, centre - 4);
  ctx.textAlign = "left";
  label(orbit.y, centre + 4, 11);
  ctx.beginPath();
  ctx.moveTo(6, side - 6);
  ctx.lineTo(6 + bar * scale, side - 6);
  ctx.stroke();
  ctx.fillText(`${+(bar * 1e6).toPrecision(2)} µm`, 6, side - 11);
}

function drawTrace(ctx, side, x, y, scale, palette) {
  const centre = side / 2;
  const px = (k) => centre + x[k] * scale;
  const py = (k) => centre - y[k] * scale;
  ctx.strokeStyle = palette.lines[0];
  ctx.lineWidth = 1.2;
  ctx.lineJoin = "round";
  ctx.beginPath();
  for (let k = 0; k < x.length; k++) (k ? ctx.lineTo(px(k), py(k)) : ctx.moveTo(px(k), py(k)));
  ctx.stroke();
  if (!x.length) return;
  ctx.fillStyle = palette.lines[1];
  ctx.beginPath();
  ctx.arc(px(x.length - 1), py(x.length - 1), 3.5, 0, 2 * Math.PI);
  ctx.fill();
}

/** One orbit in the document: {node, show(x, y, zoom)}; x and y in m. */
export function orbitOf(orbit, palette) {
  const node = document.createElement("figure");
  node.className = "orbit";
  node.appendChild(document.createElement("figcaption")).textContent = orbit.name;
  const canvas = node.appendChild(document.createElement("canvas"));
  canvas.setAttribute("role", "img");
  const note = node.appendChild(document.createElement("p"));
  note.className = "soft small";
  let seen = [new Float32Array(0), new Float32Array(0)];
  const draw = (zoom) => {
    const [x, y] = seen;
    const side = canvas.clientWidth || 240;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(side * ratio)) canvas.width = canvas.height = Math.round(side * ratio);
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, side, side);
    const colours = palette();
    const { half, bar } = scaleOf(orbit, x, y, zoom);
    const scale = side / 2 / half;
    drawZones(ctx, side, orbit, scale, colours);
    if (orbit.clearance_m) {
      ctx.strokeStyle = colours.limit;
      ctx.lineWidth = 1.6;
      circle(ctx, side / 2, orbit.clearance_m * scale);
    }
    drawAxes(ctx, side, orbit, colours, bar, scale);
    drawTrace(ctx, side, x, y, scale, colours);
    let reach = 0;
    for (let k = 0; k < x.length; k++) reach = Math.max(reach, Math.hypot(x[k], y[k]));
    const share = orbit.clearance_m ? `, ${Math.round(100 * reach / orbit.clearance_m)} % of the clearance ${+(orbit.clearance_m * 1e6).toPrecision(3)} µm` : "";
    note.textContent = x.length ? `out to ${+(reach * 1e6).toPrecision(3)} µm${share}` : "no sample yet";
    canvas.setAttribute("aria-label", `Orbit ${orbit.name}: ${note.textContent}`);
  };
  return { node, show: (x, y, zoom) => { seen = [x, y]; draw(zoom); }, redraw: draw };
}
