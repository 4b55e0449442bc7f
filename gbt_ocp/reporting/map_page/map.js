"use strict";
// The map of a replayed log: the own way, the tracks with their 95 % ellipses, the range and the residuals by sensor.
const log = JSON.parse(document.getElementById("data").textContent);
const count = log.times.length, first = log.times[0], last = log.times[count - 1];
const at = (name) => document.getElementById(name);
const map = at("map"), slider = at("when");
const known = (place) => place && place[0] !== null && place[1] !== null;
const lines = [{ name: "own vehicle", colour: "#7F7F7F", places: log.own }];
if (log.truth) lines.push({ name: "target, true", colour: "#000000", places: log.truth });
for (const track of log.tracks) lines.push({ name: track.name, colour: track.colour, places: track.mean, track });

let view = null; // metres at the middle, and metres a pixel

function legend() {
  for (const line of lines) {
    const key = document.createElement("span");
    key.className = "key";
    key.style.setProperty("--colour", line.colour);
    key.textContent = line.name;
    at("legend").append(key);
  }
}

function sized(canvas) {
  const box = canvas.getBoundingClientRect(), scale = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(box.width * scale));
  canvas.height = Math.max(1, Math.round(box.height * scale));
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  return [pen, box.width, box.height];
}

function fit(width, height) {
  const places = lines.flatMap((line) => line.places.filter(known).slice(line.track ? Math.floor(count / 10) : 0));
  const middle = [], span = [];
  for (const axis of [0, 1]) {
    const values = places.map((place) => place[axis]).sort((a, b) => a - b);
    const low = values[Math.floor(0.01 * (values.length - 1))], high = values[Math.ceil(0.99 * (values.length - 1))];
    middle.push(0.5 * (low + high));
    span.push(Math.max(high - low, 1));
  }
  view = { middle, scale: 1.25 * Math.max(span[0] / width, span[1] / height) };
}

function drawMap() {
  const [pen, width, height] = sized(map);
  if (!view) fit(width, height);
  const x = (place) => 0.5 * width + (place[0] - view.middle[0]) / view.scale;
  const y = (place) => 0.5 * height - (place[1] - view.middle[1]) / view.scale;
  const now = Number(slider.value);
  for (const line of lines) {
    pen.strokeStyle = pen.fillStyle = line.colour;
    pen.lineWidth = 1.5;
    pen.beginPath();
    let drawing = false;
    for (let k = 0; k <= now; k += 1) {
      const place = line.places[k];
      if (!known(place)) { drawing = false; continue; }
      if (drawing) pen.lineTo(x(place), y(place)); else pen.moveTo(x(place), y(place));
      drawing = true;
    }
    pen.stroke();
    const here = line.places[now];
    if (known(here)) {
      pen.beginPath();
      pen.arc(x(here), y(here), 4, 0, 2 * Math.PI);
      pen.fill();
      const ellipse = line.track && line.track.ellipse[now];
      if (ellipse && ellipse[0] !== null) {
        pen.beginPath();
        pen.ellipse(x(here), y(here), ellipse[0] / view.scale, ellipse[1] / view.scale, -ellipse[2], 0, 2 * Math.PI);
        pen.stroke();
      }
    }
  }
  const own = log.own[now], azimuth = log.azimuth[now];
  if (azimuth !== null) {
    pen.setLineDash([4, 4]);
    pen.strokeStyle = "#7F7F7F";
    pen.beginPath();
    pen.moveTo(x(own), y(own));
    pen.lineTo(x(own) + 5000 * Math.cos(azimuth), y(own) - 5000 * Math.sin(azimuth));
    pen.stroke();
    pen.setLineDash([]);
  }
  drawScale(pen, height);
}

function drawScale(pen, height) {
  const rough = 100 * view.scale, power = 10 ** Math.floor(Math.log10(rough));
  const length = [1, 2, 5, 10].map((step) => step * power).filter((step) => step <= rough).pop();
  pen.strokeStyle = pen.fillStyle = "#111";
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(14, height - 14);
  pen.lineTo(14 + length / view.scale, height - 14);
  pen.moveTo(20, 46);
  pen.lineTo(20, 20);
  pen.lineTo(15, 28);
  pen.moveTo(20, 20);
  pen.lineTo(25, 28);
  pen.stroke();
  pen.font = "12px system-ui, sans-serif";
  pen.fillText(`${length} m`, 14, height - 20);
  pen.fillText("N", 16, 14);
}

function chart(canvas, low, high, unit, draw) {
  const [pen, width, height] = sized(canvas);
  const left = 62, x = (t) => left + (width - left - 12) * (t - first) / Math.max(last - first, 1e-9);
  const y = (value) => height - 18 - (height - 28) * (value - low) / (high - low);
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = "#555";
  for (const value of [low, 0.5 * (low + high), high]) pen.fillText(`${Number(value.toPrecision(3))} ${unit}`, 4, y(value) + 4);
  pen.fillText(`${Number((last - first).toPrecision(6))} s`, width - 70, height - 3);
  pen.save();
  pen.beginPath();
  pen.rect(left, 4, width - left, height - 18);
  pen.clip();
  draw(pen, x, y);
  pen.strokeStyle = "#999";
  pen.beginPath();
  pen.moveTo(x(log.times[Number(slider.value)]), 0);
  pen.lineTo(x(log.times[Number(slider.value)]), height);
  pen.stroke();
  pen.restore();
}

function drawRange() {
  const settled = log.tracks[0].range.filter((value, k) => value !== null && k >= count / 10).sort((a, b) => a - b);
  const top = 2 * (settled[Math.floor(0.9 * (settled.length - 1))] || 1);
  chart(at("range"), 0, top, "m", (pen, x, y) => {
    for (const track of log.tracks) {
      pen.strokeStyle = pen.fillStyle = track.colour;
      pen.globalAlpha = 0.15;
      for (let k = 1; k < count; k += 1) {
        if (track.range[k] === null || track.rangeStd[k] === null) continue;
        const low = Math.max(track.range[k] - 1.96 * track.rangeStd[k], 0), high = track.range[k] + 1.96 * track.rangeStd[k];
        pen.fillRect(x(log.times[k - 1]), y(high), Math.max(x(log.times[k]) - x(log.times[k - 1]), 1), y(low) - y(high));
      }
      pen.globalAlpha = 1;
      track.range.forEach((value, k) => { if (value !== null) pen.fillRect(x(log.times[k]) - 0.7, y(value) - 0.7, 1.4, 1.4); });
    }
    pen.fillStyle = "#000";
    (log.trueRange || []).forEach((value, k) => { if (value !== null) pen.fillRect(x(log.times[k]) - 0.7, y(value) - 0.7, 1.4, 1.4); });
  });
}

function drawResiduals() {
  const values = log.residuals.filter((value) => value !== null).map(Math.abs).sort((a, b) => a - b);
  const top = 1.3 * (values[Math.floor(0.98 * (values.length - 1))] || 1);
  chart(at("residuals"), -top, top, "°", (pen, x, y) => {
    log.residuals.forEach((value, k) => {
      if (value === null) return;
      pen.fillStyle = log.sensors[log.sensorOf[k]].colour;
      pen.fillRect(x(log.times[k]) - 1, y(value) - 1, 2, 2);
    });
  });
}

function readout() {
  const now = Number(slider.value), rows = [["time", log.clock ? log.clock[now] : `${log.times[now].toFixed(2)} s`]];
  rows.push(["measured", `${log.kinds[now]} by ${log.sensors[log.sensorOf[now]].name}`]);
  for (const track of log.tracks) {
    const place = track.mean[now];
    if (!known(place)) continue;
    rows.push([track.name, place.map((value) => value.toFixed(1)).join(", ") + " m"]);
    if (track.geographic) rows.push(["", track.geographic[now].map((value) => value.toFixed(6)).join(", ") + "°"]);
    if (track.rangeStd[now] !== null) rows.push(["range", `${track.range[now].toFixed(1)} ± ${track.rangeStd[now].toFixed(1)} m`]);
  }
  at("readout").replaceChildren(...rows.map((cells) => {
    const row = document.createElement("tr");
    for (const text of cells) row.insertCell().textContent = text;
    return row;
  }));
  at("time").textContent = rows[0][1];
}

function draw() {
  readout();
  drawMap();
  drawRange();
  drawResiduals();
}

slider.max = String(count - 1);
slider.value = String(count - 1);
slider.addEventListener("input", draw);
window.addEventListener("resize", draw);
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  view.scale *= Math.exp(0.0015 * event.deltaY);
  drawMap();
}, { passive: false });
map.addEventListener("dblclick", () => { view = null; drawMap(); });
map.addEventListener("pointermove", (event) => {
  if (!event.buttons) return;
  view.middle[0] -= event.movementX * view.scale;
  view.middle[1] += event.movementY * view.scale;
  drawMap();
});
legend();
draw();
