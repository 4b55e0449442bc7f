// The run: its arrays, a step at a time, and how numbers are written.
const run = JSON.parse(document.getElementById("data").textContent);
const d = run.dimension, K = run.steps, N = run.times, P = run.pieces;
const A = Object.fromEntries(Object.entries(run.arrays).map(([name, [bits, text]]) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return [name, bits === 64 ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer)];
}));
const COLOUR = { target: "#000000", vehicle: "#0072B2", bearing: "#7F7F7F", forecast: "#D55E00", plan: "#009E73" };
const AXIS = ["x", "y", "z"];
const by = (id) => document.getElementById(id);
const [view, chart, tip, scrub, mode, speed] = ["view", "chart", "tip", "scrub", "mode", "speed"].map(by);

const row = (array, index, width) => array.subarray(index * width, (index + 1) * width);
const target = (k) => row(A.target, k, d), vehicle = (k) => row(A.vehicle, k, d);
const mean = (k, j) => row(A.mean, k * N + j, d), plan = (k, i) => row(A.plan, k * (P + 1) + i, d);
const finite = (values) => values.every(Number.isFinite);
function covariance(k, j) {
  const size = d * (d + 1) / 2, flat = row(A.covariance, k * N + j, size);
  const S = Array.from({ length: d }, () => new Array(d));
  let next = 0;
  for (let a = 0; a < d; a++) for (let b = a; b < d; b++) S[a][b] = S[b][a] = flat[next++];
  return S;
}

function number(value, digits = 3) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "–" : "∞";
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
}
const metres = (value) => (value === 0 || Math.abs(value) >= 0.001 ? value.toFixed(3) : value.toExponential(1));
const place = (point) => `(${Array.from(point, metres).join(", ")}) m`;
