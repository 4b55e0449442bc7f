// The player: what is read out at a step, time, pointer and keys.
function readOut() {
  const k = state.k, fallback = run.fallback[k], status = run.statusWords[A.status[k]];
  const rows = [
    ["time", `${A.t[k].toFixed(2)} s`],
    ["step", `${k} of ${K - 1}`],
    ["error, mean of forecast", `${number(A.meanError[k])} m`],
    ["error now", `${number(A.error[k * N])} m`],
    ["range", `${number(A.distance[k])} m`],
    ["condition number", number(A.condition[k])],
    ["bearing", finite(row(A.bearing, k, d)) ? "measured" : "missed"],
    ["solver", status ? status + (fallback ? `, ${fallback}` : "") : "none"],
    ["solver time", Number.isFinite(A.solverTime[k]) ? `${number(A.solverTime[k])} ms` : "–"],
  ];
  by("readout").innerHTML = "";
  for (const [name, value] of rows) {
    const line = by("readout").insertRow();
    const head = document.createElement("th");
    head.textContent = name;
    line.append(head);
    line.insertCell().textContent = value;
  }
}

function show() {
  scrub.value = state.k;
  draw();
  drawChart();
  readOut();
  tip.hidden = true;
}

// Time ---------------------------------------------------------------------------------------------------------------

function seek(k) {
  state.k = Math.min(K - 1, Math.max(0, Math.round(k)));
  state.clock = A.t[state.k];
  show();
}

function play(on = !state.playing) {
  if (on && state.k === K - 1) seek(0);
  state.playing = on;
  state.last = null;
  by("play").textContent = on ? "pause" : "play";
  if (on) requestAnimationFrame(tick);
}

function tick(now) {
  if (!state.playing) return;
  if (state.last !== null) {
    state.clock += Number(speed.value) * Math.min(0.25, (now - state.last) / 1000);
    let k = state.k;
    while (k < K - 1 && A.t[k + 1] <= state.clock + 1e-6) k++;
    if (k !== state.k) { state.k = k; show(); }
    if (k === K - 1) play(false);
  }
  state.last = now;
  if (state.playing) requestAnimationFrame(tick);
}

// Pointer and keys --------------------------------------------------------------------------------------------------------------

function hover(x, y) {
  // Marks of this moment are preferred to the paths under them.
  const weight = { forecast: 0.6, plan: 0.6, target: 1, vehicle: 1 };
  let best = null, least = 14;
  for (const item of marks) {
    const away = Math.hypot(item.pixel[0] - x, item.pixel[1] - y) * weight[item.kind];
    if (away < least) [best, least] = [item, away];
  }
  tip.hidden = best === null;
  if (best === null) return;
  tip.textContent = best.text();
  const stage = by("stage").getBoundingClientRect();
  tip.style.left = `${Math.max(0, Math.min(x + 14, stage.width - tip.offsetWidth - 4))}px`;
  tip.style.top = `${Math.max(0, Math.min(y + 14, stage.height - tip.offsetHeight - 4))}px`;
}

let held = null;
view.addEventListener("pointerdown", (event) => {
  held = [event.clientX, event.clientY];
  try { view.setPointerCapture(event.pointerId); } catch { /* the pointer is gone already */ }
});
view.addEventListener("pointerup", () => { held = null; });
view.addEventListener("pointermove", (event) => {
  if (held === null) {
    const box = view.getBoundingClientRect();
    hover(event.clientX - box.left, event.clientY - box.top);
    return;
  }
  const [x, y] = [event.clientX - held[0], event.clientY - held[1]];
  held = [event.clientX, event.clientY];
  if (d === 3 && !event.shiftKey) {
    camera.azimuth -= 0.01 * x;
    camera.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, camera.elevation + 0.01 * y));
  } else {
    camera.shift = [camera.shift[0] + x, camera.shift[1] + y];
  }
  draw();
});
view.addEventListener("pointerleave", () => { tip.hidden = true; });
view.addEventListener("wheel", (event) => {
  event.preventDefault();
  const box = view.getBoundingClientRect(), factor = Math.exp(-0.0015 * event.deltaY);
  // The point under the pointer stays there.
  const away = [event.clientX - box.left - camera.origin[0], event.clientY - box.top - camera.origin[1]];
  camera.shift = camera.shift.map((value, i) => value + away[i] * (1 - factor));
  camera.zoom *= factor;
  draw();
}, { passive: false });

chart.addEventListener("click", (event) => {
  const t = chart.timeAt(event.clientX - chart.getBoundingClientRect().left);
  let k = 0;
  while (k < K - 1 && A.t[k + 1] <= t) k++;
  seek(k);
});
scrub.max = K - 1;
scrub.addEventListener("input", () => seek(Number(scrub.value)));
by("play").addEventListener("click", () => play());
by("back").addEventListener("click", () => { play(false); seek(state.k - 1); });
by("forward").addEventListener("click", () => { play(false); seek(state.k + 1); });
by("reset").addEventListener("click", () => { camera.reset(); show(); });
mode.addEventListener("change", () => { camera.reset(); show(); });
// Also when the table beside them grows: what was drawn would be stretched to the new size.
const sizes = new ResizeObserver(() => show());
sizes.observe(view);
sizes.observe(chart);
window.addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName) && event.key === " ") return;
  if (event.target.tagName === "SELECT" || event.target.tagName === "INPUT") return;
  const go = { " ": () => play(), ArrowLeft: () => seek(state.k - 1), ArrowRight: () => seek(state.k + 1), Home: () => seek(0), End: () => seek(K - 1) };
  if (go[event.key]) { event.preventDefault(); go[event.key](); }
});
for (const factor of [0.25, 0.5, 1, 2, 4]) {
  const rate = factor * run.speed;
  speed.add(new Option(`${number(rate)} ×`, String(rate), factor === 1, factor === 1));
}
by("hint").textContent = d === 3 ? "drag turns, shift-drag moves, wheel zooms" : "drag moves, wheel zooms";

// page.html#step=57&view=target opens there.
const wanted = new URLSearchParams(location.hash.slice(1));
if (wanted.get("view") === "target") mode.value = "target";
seek(Number(wanted.get("step")) || 0);
