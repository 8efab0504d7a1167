// The page of `clvol view`: sends wishes, shows the pictures that come back.
"use strict";

const at = (id) => document.getElementById(id);
const canvas = at("picture"), paper = canvas.getContext("2d");
const DEGREES = Math.PI / 180, STEEPEST = 0.5 * DEGREES, COMPARED = 3, PATIENCE_MS = 60000;
const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

function turned(v, axis, angle) {  // Rodrigues
  const c = Math.cos(angle), s = Math.sin(angle), along = dot(axis, v) * (1 - c), side = cross(axis, v);
  return v.map((x, i) => x * c + side[i] * s + axis[i] * along);
}

let scene = null, camera = null, socket = null, due = false;
const wish = {camera: null, density: 1, glow: 1, anisotropy: null, azimuth: null, elevation: null, turn: 0, opacity: null,
              technique: "auto", transmittance: "auto", denoise: false, exposure: 0};
const KNOBS = {  // what a slider's place means, and how it is written
  exposure: [(x) => x, (x) => `${x > 0 ? "+" : ""}${x.toFixed(1)} stops`],
  density: [(x) => 2 ** x, (x) => `× ${(2 ** x).toPrecision(3)}`],
  glow: [(x) => 2 ** x, (x) => `× ${(2 ** x).toPrecision(3)}`],
  anisotropy: [(x) => x, (x) => x.toFixed(2)],
  azimuth: [(x) => x, (x) => `${x}°`],
  elevation: [(x) => x, (x) => `${x}°`],
  turn: [(x) => x, (x) => `${x}°`],
};

// ---- what goes out: the latest wish, one at a time

function send() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(wish));
  });
}

function look() {
  wish.camera = [...add(camera.target, camera.offset), ...camera.target, ...camera.up];
  send();
}

// ---- the camera goes round what it looks at

function orbit(right, above) {  // radians
  const axis = scene.axes.up;
  const side = unit(cross(camera.up, camera.offset));
  const now = Math.acos(Math.max(-1, Math.min(1, dot(unit(camera.offset), axis))));
  if (now - above < STEEPEST || now - above > Math.PI - STEEPEST) above = 0;
  for (const key of ["offset", "up"]) {
    camera[key] = turned(turned(camera[key], side, -above), axis, right);
  }
  look();
}

function pan(x, y) {  // pixels of the page
  const pixel = 2 * Math.tan(scene.x_fov * DEGREES / 2) * Math.hypot(...camera.offset) / canvas.clientWidth;
  const side = unit(cross(camera.up, camera.offset)), above = unit(cross(camera.offset, side));
  camera.target = add(add(camera.target, side, -x * pixel), above, y * pixel);
  look();
}

function zoom(factor) {
  camera.offset = camera.offset.map((x) => x * factor);
  look();
}

function stand(azimuth, elevation) {
  const {up, front, right} = scene.axes, a = azimuth * DEGREES, e = elevation * DEGREES;
  const level = add(front.map((x) => x * Math.cos(a)), right, Math.sin(a));
  const towards = add(level.map((x) => x * Math.cos(e)), up, Math.sin(e));
  const distance = Math.hypot(...camera.offset);
  camera.offset = towards.map((x) => x * distance);
  camera.up = up;
  look();
}

function reset() {
  const [eye, target, up] = [0, 3, 6].map((n) => scene.camera.slice(n, n + 3));
  camera = {target, offset: add(eye, target, -1), up};
  wish.camera = null;
  send();
}

const pointers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, event);
});
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before || !camera) return;
  const x = event.clientX - before.clientX, y = event.clientY - before.clientY;
  pointers.set(event.pointerId, event);
  if (pointers.size === 2) {  // two fingers: they move it, and spread to zoom
    const [other] = [...pointers.values()].filter((one) => one.pointerId !== event.pointerId);
    const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
    pan(x / 2, y / 2);
    zoom(apart(before) / apart(event));
  } else if (event.shiftKey || event.buttons & 6) pan(x, y);
  else orbit(-x * 0.4 * DEGREES, y * 0.4 * DEGREES);
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
}
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (camera) zoom(Math.exp(Math.max(-100, Math.min(100, event.deltaY)) * 0.0015));
}, {passive: false});
canvas.addEventListener("keydown", (event) => {
  if (!camera || event.ctrlKey || event.metaKey || event.altKey) return;
  const step = 5 * DEGREES;
  const keys = {ArrowLeft: () => orbit(-step, 0), ArrowRight: () => orbit(step, 0),
                ArrowUp: () => orbit(0, step), ArrowDown: () => orbit(0, -step),
                "+": () => zoom(0.9), "-": () => zoom(1 / 0.9), r: reset, R: reset};
  if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
});

// ---- knobs

function write(slider) {
  const value = Number(slider.value);
  slider.closest("label").querySelector("output").textContent = KNOBS[slider.dataset.knob][1](value);
}

for (const slider of document.querySelectorAll("[data-knob]")) {
  write(slider);
  slider.addEventListener("input", () => {
    const knob = slider.dataset.knob;
    wish[knob] = KNOBS[knob][0](Number(slider.value));
    if (knob === "exposure") at("automatic").checked = false;
    write(slider);
    send();
  });
}
at("automatic").addEventListener("change", (event) => {
  wish.exposure = event.target.checked ? "auto" : Number(document.querySelector("[data-knob=exposure]").value);
  send();
});
at("denoise").addEventListener("change", (event) => { wish.denoise = event.target.checked; send(); });
at("views").addEventListener("click", (event) => {
  const {azimuth, elevation} = event.target.dataset;
  if (azimuth !== undefined && camera) stand(Number(azimuth), Number(elevation));
});
at("reset").addEventListener("click", () => camera && reset());
for (const family of ["technique", "transmittance"]) {
  at(family).addEventListener("change", (event) => {
    wish[family] = event.target.value;
    at("summary").textContent = scene.families[family][event.target.value] || "";
    send();
  });
}
at("copy").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(at("command").textContent);
  } catch {  // pages of other machines may not write there: mark it
    getSelection().selectAllChildren(at("command"));
  }
  at("copy").textContent = "Copied";
  setTimeout(() => { at("copy").textContent = "Copy the command"; }, 1500);
});

// ---- the transfer function: a curve whose points are dragged

const curve = at("curve"), EDGE = 8, GRIP = 12;
let points = null, plane = null, held = null;

function within(point) {  // where a point is on the curve's canvas
  const share = (point[0] - plane.low) / (plane.high - plane.low);
  return [EDGE + share * (curve.width - 2 * EDGE), curve.height - EDGE - point[1] / plane.most * (curve.height - 2 * EDGE)];
}

function pointed(event) {  // the value and the opacity that are pointed at
  const box = curve.getBoundingClientRect();
  const x = (event.clientX - box.x) / box.width * curve.width, y = (event.clientY - box.y) / box.height * curve.height;
  const share = (x - EDGE) / (curve.width - 2 * EDGE), up = (curve.height - EDGE - y) / (curve.height - 2 * EDGE);
  const near = points.findIndex((point) => Math.hypot(...add(within(point), [x, y], -1)) < GRIP);
  const level = Math.min(Math.max(up, 0), 1) * plane.most;
  return {near, point: [plane.low + Math.min(Math.max(share, 0), 1) * (plane.high - plane.low), level]};
}

function draw() {
  const ink = curve.getContext("2d"), last = points.length - 1, bottom = curve.height - EDGE;
  const path = [[0, within(points[0])[1]], ...points.map(within), [curve.width, within(points[last])[1]]];
  ink.clearRect(0, 0, curve.width, curve.height);
  const fill = ink.createLinearGradient(within([plane.first, 0])[0], 0, within([plane.last, 0])[0], 0);
  scene.colours.forEach((colour, n) => {
    fill.addColorStop(n / (scene.colours.length - 1), `color(srgb-linear ${colour.join(" ")} / 0.75)`);
  });
  ink.fillStyle = scene.colours.length ? fill : "#98a1b0";
  ink.beginPath();
  ink.moveTo(0, bottom);
  for (const place of path) ink.lineTo(...place);
  ink.lineTo(curve.width, bottom);
  ink.fill();
  ink.strokeStyle = "#e4e7ec";
  ink.beginPath();
  for (const place of path) ink.lineTo(...place);
  ink.stroke();
  for (const [n, point] of points.entries()) {
    ink.beginPath();
    ink.arc(...within(point), 4.5, 0, 2 * Math.PI);
    ink.fillStyle = n === held ? "#ff9d4d" : "#e4e7ec";
    ink.fill();
  }
  const shown = points[held];
  at("transfer").querySelector("output").textContent =
    shown ? `${Number(shown[0].toPrecision(4))}: ${Number(shown[1].toPrecision(3))}` : "";
}

function start(first) {
  points = first.map((point) => [...point]);
  const [low, high] = [points[0][0], points[points.length - 1][0]], margin = 0.08 * (high - low || 1);
  const most = 1.3 * Math.max(...points.map((point) => point[1])) || 1;
  plane = {first: low, last: high, low: low - margin, high: high + margin, most};
  draw();
}

function bend() {
  wish.opacity = points.map((point) => [...point]);
  draw();
  send();
}

curve.addEventListener("pointerdown", (event) => {
  const {near} = pointed(event);
  held = near < 0 ? null : near;
  curve.setPointerCapture(event.pointerId);
  draw();
});
curve.addEventListener("pointermove", (event) => {
  if (held === null || !event.buttons) return;
  const {point} = pointed(event);
  const before = held ? points[held - 1][0] : -Infinity, after = held < points.length - 1 ? points[held + 1][0] : Infinity;
  points[held] = [Math.min(Math.max(point[0], before), after), point[1]];
  bend();
});
curve.addEventListener("dblclick", (event) => {
  const {near, point} = pointed(event);
  if (near >= 0 && points.length > 2) points.splice(near, 1);
  else if (near < 0) {
    const next = points.findIndex((one) => one[0] > point[0]);
    points.splice(next < 0 ? points.length : next, 0, point);
  }
  held = null;
  bend();
});

// ---- methods side by side, on what is seen now

const methods = new Map();
const pause = (ms) => new Promise((then) => setTimeout(then, ms));
let latest = null, failed = false;  // what was said of the last picture; whether a wish could not be had
let seen = "";

function short(number) {
  return new Intl.NumberFormat("en", {notation: "compact", maximumSignificantDigits: 3}).format(number);
}

function percent(noise) {
  return noise === null ? "–" : `${(100 * noise).toPrecision(2)} %`;
}

function tabulate(said) {
  if (said.seen !== seen) { methods.clear(); seen = said.seen; }
  const name = `${said.technique}|${said.transmittance}`;
  if (!said.coarse) methods.set(name, {...said, one: said.noise === null ? null : said.noise * Math.sqrt(said.seconds)});
  const known = [...methods.values()].filter((one) => one.one !== null && one.spp > 1);
  const least = Math.min(...known.map((one) => one.one));
  at("methods").replaceChildren(...[...methods].map(([key, one]) => {
    const row = document.createElement("tr");
    row.classList.toggle("now", key === name);
    row.classList.toggle("best", known.length > 1 && one.one === least);
    const cells = [one.technique, one.spp, short(one.rate), percent(one.noise), percent(one.one)];
    for (const text of cells) row.appendChild(document.createElement("td")).textContent = text;
    const small = row.firstChild.appendChild(document.createElement("small"));
    small.textContent = one.transmittance;
    return row;
  }));
}

at("compare").addEventListener("click", async () => {
  const button = at("compare"), before = wish.technique;
  if (button.dataset.stop) { button.dataset.stop = "now"; return; }
  button.dataset.stop = "no";
  const names = scene.compared;
  const view = latest && latest.seen;
  for (const [number, name] of names.entries()) {
    button.textContent = `${name} (${number + 1} of ${names.length}): stop`;
    at("technique").value = wish.technique = name;
    latest = null;
    failed = false;
    send();
    const end = Date.now() + PATIENCE_MS;  // kernels may have to be built
    const tried = () => latest && latest.wished === name && !latest.coarse && latest.spp > 1
      && (latest.seconds >= COMPARED || latest.is_last);
    while (button.dataset.stop === "no" && !failed && Date.now() < end && !tried()) await pause(100);
    if (button.dataset.stop === "now" || (latest && latest.seen !== view)) break;
  }
  delete button.dataset.stop;
  button.textContent = "Compare techniques";
  at("technique").value = wish.technique = before;
  send();
});

// ---- what comes in

function meet(said) {
  scene = said;
  at("name").textContent = said.name.split("/").pop();
  at("name").title = said.name;
  document.title = `${at("name").textContent} – clvol view`;
  [canvas.width, canvas.height] = said.size;
  canvas.style.setProperty("--width", said.size[0]);
  canvas.style.setProperty("--height", said.size[1]);
  const there = {sun: !!said.sun, environment: said.environment, light: !!said.sun || said.environment};
  for (const knob of ["density", "anisotropy", "glow", "opacity"]) there[knob] = said.knobs.includes(knob);
  for (const part of document.querySelectorAll("[data-for]")) part.hidden = !there[part.dataset.for];
  if (!camera) begin(said.first);
  if (said.opacity && !points) start(said.opacity);
  const places = {anisotropy: said.anisotropy, azimuth: said.sun && said.sun[0], elevation: said.sun && said.sun[1]};
  for (const [knob, place] of Object.entries(places)) {
    if (place === undefined || place === null || wish[knob] !== null) continue;
    const slider = document.querySelector(`[data-knob=${knob}]`);
    slider.value = place;
    write(slider);
  }
  at("denoise").disabled = !said.denoiser;
  at("nodenoise").hidden = said.denoiser;
  for (const family of ["technique", "transmittance"]) {
    at(family).replaceChildren(...["auto", ...Object.keys(said.families[family])].map((name) => {
      const option = document.createElement("option");
      option.textContent = option.value = name;
      option.title = said.families[family][name] || "chosen by clvol";
      return option;
    }));
    at(family).value = wish[family];
  }
  if (camera) send();
  else reset();
}

function begin(first) {  // as the command line has it
  Object.assign(wish, first);
  at("automatic").checked = first.exposure === "auto";
  at("denoise").checked = first.denoise;
  const slider = document.querySelector("[data-knob=exposure]");
  slider.value = first.exposure === "auto" ? 0 : first.exposure;
  write(slider);
}

async function show(said, data) {
  const image = await createImageBitmap(new Blob([data], {type: said.type}));
  if (said.number < shown) return;  // decoded later than the one after it
  shown = said.number;
  paper.clearRect(0, 0, canvas.width, canvas.height);
  paper.imageSmoothingQuality = "high";
  paper.drawImage(image, 0, 0, canvas.width, canvas.height);
  image.close();
  document.body.dataset.pictures = shown;
  document.body.dataset.coarse = said.coarse;
  at("error").hidden = true;
  latest = said;
  at("command").textContent = said.command;
  const noise = said.noise === null ? "" : `, noise ${percent(said.noise)}`;
  const rate = `${short(said.rate)} samples/s`;
  at("status").textContent = said.coarse ? "moving …"
    : `${said.spp} spp${noise}, ${rate}${said.is_last ? ", done" : ""}`;
  at("progress").firstElementChild.style.width = said.coarse ? "0" : `${100 * said.spp / said.most}%`;
  tabulate(said);
}

let received = 0, shown = 0;

function receive(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const said = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  if (said.kind === "scene") meet(said);
  else if (said.kind === "error") {
    failed = true;
    at("error").textContent = said.text;
    at("error").hidden = false;
  } else {
    said.number = ++received;
    show(said, new Uint8Array(buffer, 4 + length));
  }
}

function connect() {
  const address = new URL("live", location.href);
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => receive(event.data);
  socket.onclose = () => {
    at("status").textContent = "the renderer is gone; trying again …";
    setTimeout(connect, 2000);
  };
}

connect();
