// Plays with the page as a reader would, and leaves what it saw as JSON in #probe.
(async () => {
  const found = {};
  window.addEventListener("error", (event) => { found.fault = event.message; });
  const pause = (ms) => new Promise((done) => setTimeout(done, ms));
  const shown = () => Object.fromEntries(Array.from(document.querySelectorAll("#readout tr"),
    (line) => [line.children[0].textContent, line.children[1].textContent]));
  const inked = (id) => { const c = document.getElementById(id);
    return c.getContext("2d").getImageData(0, 0, c.width, c.height).data.reduce((n, v, i) => n + (i % 4 === 3 && v > 0), 0); };
  const at = (type, x, y, more = {}) => { const box = document.getElementById("view").getBoundingClientRect();
    document.getElementById("view").dispatchEvent(new PointerEvent(type, { clientX: box.left + x, clientY: box.top + y,
      pointerId: 1, bubbles: true, ...more })); };
  // Headless browsers draw frames as they please, some none in half a second of their virtual time.
  window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);
  const slide = document.getElementById("scrub");
  found.max = slide.max;
  slide.value = 12; slide.dispatchEvent(new Event("input"));
  found.scrubbed = shown();
  found.ink = [inked("view"), inked("chart")];
  found.tips = {};
  for (const kind of ["target", "vehicle", "forecast", "plan"]) {
    const chosen = marks.filter((item) => item.kind === kind).at(kind === "target" || kind === "vehicle" ? 25 : -1);
    if (!chosen) continue;
    const tip = document.getElementById("tip");
    // The very point, where nothing else of the run lies over it.
    marks = marks.filter((item) => item === chosen || Math.hypot(item.pixel[0] - chosen.pixel[0], item.pixel[1] - chosen.pixel[1]) > 30);
    at("pointermove", chosen.pixel[0] + 1, chosen.pixel[1]);
    found.tips[kind] = tip.hidden ? null : tip.textContent;
    seek(12);
  }
  at("pointermove", 2, 2);
  const before = marks.map((item) => item.pixel.slice());
  at("pointerdown", 100, 100); at("pointermove", 140, 100); at("pointerup", 140, 100);
  found.dragged = Math.max(...marks.map((item, i) => Math.hypot(item.pixel[0] - before[i][0], item.pixel[1] - before[i][1])));
  document.getElementById("reset").click();
  found.reset = Math.max(...marks.map((item, i) => Math.hypot(item.pixel[0] - before[i][0], item.pixel[1] - before[i][1])));
  document.getElementById("mode").value = "target"; document.getElementById("mode").dispatchEvent(new Event("change"));
  const stage = document.getElementById("view").getBoundingClientRect(), centre = camera.project(target(12));
  found.followed = [centre[0] - stage.width / 2, centre[1] - stage.height / 2];
  document.getElementById("play").click();
  found.playing = document.getElementById("play").textContent;
  await pause(600);
  document.getElementById("play").click();
  found.played = Number(slide.value);
  await pause(300);
  found.paused = Number(slide.value);
  document.getElementById("forward").click();
  found.forward = Number(slide.value);
  found.requests = performance.getEntriesByType("resource").length;
  document.getElementById("probe").textContent = JSON.stringify(found);
})();
