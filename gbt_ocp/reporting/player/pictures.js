// The pictures: the scene at a step, and error and range over time.
const state = { k: 0, playing: false, clock: 0, last: null };
const camera = new Camera(d);
let marks = [];

function surface(canvas) {
  const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  const [width, height] = [Math.max(1, Math.round(box.width * ratio)), Math.max(1, Math.round(box.height * ratio))];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, box.width, box.height);
  context.font = "12px system-ui, sans-serif";
  return [context, box.width, box.height];
}

function line(context, points, colour, width, dash = []) {
  context.beginPath();
  let pen = false;
  for (const [x, y] of points) {
    if (!Number.isFinite(x + y)) { pen = false; continue; }
    if (pen) context.lineTo(x, y); else context.moveTo(x, y);
    pen = true;
  }
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

function dot(context, [x, y], colour, size, square = false) {
  if (!Number.isFinite(x + y)) return;
  context.fillStyle = colour;
  context.beginPath();
  if (square) context.rect(x - size, y - size, 2 * size, 2 * size); else context.arc(x, y, size, 0, 2 * Math.PI);
  context.fill();
}

// With a halo, since lines may run behind a label.
function label(context, text, x, y) {
  context.strokeStyle = "#fff";
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}

function mark(kind, pixel, text) {
  if (Number.isFinite(pixel[0] + pixel[1])) marks.push({ kind, pixel, text });
}

function draw() {
  const [context, width, height] = surface(view), k = state.k;
  const near = mode.value === "target";
  const spans = run.high.map((high, i) => high - run.low[i]);
  const half = near ? run.closeUp * (d === 2 ? 1 : 1.25) : 0.5 * (d === 2 ? Math.max(spans[0], spans[1]) : Math.hypot(...spans)) * 1.08;
  camera.place(near ? target(k) : run.low.map((low, i) => 0.5 * (low + run.high[i])), half, width, height);
  marks = [];
  if (d === 2) grid(context, width, height); else box(context);

  const path = (of, from, to) => Array.from({ length: to - from + 1 }, (_, i) => camera.project(of(from + i)));
  line(context, path(target, 0, K - 1), "rgba(0, 0, 0, .22)", 1, [5, 4]);
  line(context, path(vehicle, 0, K - 1), "rgba(0, 114, 178, .22)", 1);
  line(context, path(target, 0, k), COLOUR.target, 1.6, [6, 4]);
  line(context, path(vehicle, 0, k), COLOUR.vehicle, 1.3);
  for (let i = 0; i < K; i++) {
    mark("target", camera.project(target(i)), () => `target, t = ${A.t[i].toFixed(2)} s\n${place(target(i))}`);
    mark("vehicle", camera.project(vehicle(i)), () => `vehicle, t = ${A.t[i].toFixed(2)} s\n${place(vehicle(i))}\n` +
      `yaw ${(A.yaw[i] * 180 / Math.PI).toFixed(1)}°, range ${number(A.distance[i])} m`);
  }
  bearing(context, k, width + height);
  forecast(context, k);
  if (P > 0) {
    const ends = Array.from({ length: P + 1 }, (_, i) => camera.project(plan(k, i)));
    line(context, ends, COLOUR.plan, 1.4);
    ends.slice(1).forEach((pixel, i) => {
      dot(context, pixel, COLOUR.plan, 2.6);
      mark("plan", pixel, () => `plan, end of piece ${i + 1} of ${P}\n${place(plan(k, i + 1))}`);
    });
  }
  dot(context, camera.project(vehicle(k)), COLOUR.vehicle, 5.5);
  dot(context, camera.project(target(k)), COLOUR.target, 4.5, true);
}

function bearing(context, k, reach) {
  const along = row(A.bearing, k, d);
  if (!finite(along)) return;
  const from = camera.project(vehicle(k)), [x, y] = camera.direction(along), length = Math.hypot(x, y);
  if (length > 1e-9) line(context, [from, [from[0] + reach * x, from[1] + reach * y]], COLOUR.bearing, 1.4, [2, 4]);
}

function forecast(context, k) {
  const centres = Array.from({ length: N }, (_, j) => camera.project(mean(k, j)));
  centres.forEach((centre, j) => {
    const S = covariance(k, j);
    if (!S.every(finite) || !Number.isFinite(centre[0] + centre[1])) return;
    const [long, short, angle] = camera.ellipse(S, run.radius);
    if (!(long < 1e6)) return;
    context.beginPath();
    context.ellipse(centre[0], centre[1], long, short, angle, 0, 2 * Math.PI);
    context.fillStyle = "rgba(213, 94, 0, .10)";
    context.fill();
    context.strokeStyle = "rgba(213, 94, 0, .55)";
    context.lineWidth = 1;
    context.stroke();
  });
  line(context, centres, COLOUR.forecast, 1.2);
  centres.forEach((centre, j) => {
    dot(context, centre, COLOUR.forecast, 2.4);
    mark("forecast", centre, () => {
      const S = covariance(k, j), deviations = S.map((line, i) => `σ${AXIS[i]} ${number(Math.sqrt(Math.max(0, line[i])))}`);
      return `forecast, ${j} of ${N - 1} periods ahead\n${place(mean(k, j))}\n${deviations.join(", ")} m\n` +
        `error ${number(A.error[k * N + j])} m`;
    });
  });
}

function grid(context, width, height) {
  const left = camera.centre[0] - camera.origin[0] / camera.scale, top = camera.centre[1] + camera.origin[1] / camera.scale;
  const right = left + width / camera.scale, bottom = top - height / camera.scale;
  const [across, digitsX] = ticks(left, right, width / 90), [up, digitsY] = ticks(bottom, top, height / 60);
  context.fillStyle = "#444";
  context.textAlign = "center";
  for (const x of across) {
    const [px] = camera.project([x, 0]);
    line(context, [[px, 0], [px, height]], "#e2e2e2", 1);
    if (px > 50 && px < width - 40) label(context, x.toFixed(digitsX), px, height - 5);
  }
  context.textAlign = "left";
  for (const y of up) {
    const py = camera.project([0, y])[1];
    line(context, [[0, py], [width, py]], "#e2e2e2", 1);
    if (py > 24 && py < height - 24) label(context, y.toFixed(digitsY), 4, py + 4);
  }
  context.fillStyle = "#111";
  context.textAlign = "right";
  label(context, "x [m]", width - 6, height - 5);
  context.textAlign = "left";
  label(context, "y [m]", 4, 14);
}

// The box around the paths (or around the target), its three edges from the lowest corner with their ticks.
function box(context) {
  const near = mode.value === "target", half = run.closeUp * 0.6;
  const low = near ? Array.from(target(state.k), (x) => x - half) : run.low;
  const high = near ? Array.from(target(state.k), (x) => x + half) : run.high;
  const corner = (bits) => low.map((value, i) => (bits >> i & 1 ? high[i] : value));
  for (let bits = 0; bits < 8; bits++) {
    for (let i = 0; i < 3; i++) {
      if (!(bits >> i & 1)) line(context, [corner(bits), corner(bits | 1 << i)].map((c) => camera.project(c)), "#cfcfcf", 1);
    }
  }
  const middle = camera.project(low.map((value, i) => 0.5 * (value + high[i])));
  context.textAlign = "center";
  for (let i = 0; i < 3; i++) {
    // Of the four edges along an axis, the lowest (or leftmost) keeps the labels outside.
    const edges = [0, 1, 2, 3, 4, 5, 6, 7].filter((bits) => !(bits >> i & 1));
    const at = (bits) => camera.project(low.map((value, j) => (j === i ? 0.5 * (value + high[j]) : corner(bits)[j])));
    const edge = edges.reduce((best, bits) => ((i < 2 ? at(bits)[1] > at(best)[1] : at(bits)[0] < at(best)[0]) ? bits : best));
    const outward = ([x, y], away) => {
      const [mx, my] = at(edge), length = Math.hypot(mx - middle[0], my - middle[1]) || 1;
      return [x + away * (mx - middle[0]) / length, y + away * (my - middle[1]) / length + 4];
    };
    // In the close-up ticks are distances from the target: absolute ones would move.
    const zero = near ? target(state.k)[i] : 0, [values, digits] = ticks(low[i] - zero, high[i] - zero, 3.5);
    context.fillStyle = "#444";
    for (const value of values) {
      const pixel = camera.project(corner(edge).map((other, j) => (j === i ? value + zero : other)));
      label(context, value.toFixed(digits), ...outward(pixel, 16));
      line(context, [pixel, outward(pixel, 5).map((c, j) => (j ? c - 4 : c))], "#888", 1);
    }
    context.fillStyle = "#111";
    label(context, near ? `${AXIS[i]} from target [m]` : `${AXIS[i]} [m]`, ...outward(at(edge), (i < 2 ? 40 : 52) + (near ? 36 : 0)));
  }
}

function drawChart() {
  const [context, width, height] = surface(chart), [left, bottom, top] = [58, 22, 6];
  const series = [[A.meanError, COLOUR.forecast, "error"], [A.distance, COLOUR.vehicle, "range"]];
  const positive = series.flatMap(([values]) => Array.from(values).filter((value) => value > 0 && Number.isFinite(value)));
  if (!positive.length) return;
  const bounds = positive.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, 0]);
  const low = Math.floor(Math.log10(bounds[0])), high = Math.max(low + 1, Math.ceil(Math.log10(bounds[1])));
  const x = (t) => left + (width - left - 12) * (t - A.t[0]) / (A.t[K - 1] - A.t[0] || 1);
  const y = (value) => height - bottom - (height - bottom - top) * (Math.log10(value) - low) / (high - low);
  chart.timeAt = (px) => A.t[0] + (A.t[K - 1] - A.t[0]) * (px - left) / (width - left - 12);
  context.fillStyle = "#444";
  context.textAlign = "right";
  for (let power = low; power <= high; power += Math.ceil((high - low) / 4)) {
    line(context, [[left, y(10 ** power)], [width - 12, y(10 ** power)]], "#e2e2e2", 1);
    context.fillText(power >= -3 && power <= 3 ? String(Number((10 ** power).toPrecision(1))) : `1e${power}`, left - 6, y(10 ** power) + 4);
  }
  context.textAlign = "center";
  const [seconds, digits] = ticks(A.t[0], A.t[K - 1], width / 90);
  for (const t of seconds) context.fillText(`${t.toFixed(digits)} s`, x(t), height - 6);
  series.forEach(([values, colour, name], i) => {
    line(context, Array.from(values, (value, k) => [x(A.t[k]), value > 0 ? y(value) : NaN]), colour, 1.4);
    context.fillStyle = colour;
    context.textAlign = "right";
    context.fillText(`${name} [m]`, width - 16 - 62 * i, top + 10);
  });
  line(context, [[x(A.t[state.k]), top], [x(A.t[state.k]), height - bottom]], "#111", 1);
}
