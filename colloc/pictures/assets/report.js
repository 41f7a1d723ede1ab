"use strict";
// Draws the body in the lab frame and moves the cursors of the charts. All numbers come from the JSON block "motion".
(function () {
  const data = JSON.parse(document.getElementById("motion").textContent);
  const canvas = document.getElementById("stage");
  const slider = document.getElementById("phase");
  const button = document.getElementById("play");
  const shown = document.getElementById("phase-shown");
  const rate = document.getElementById("rate");
  const arrows = document.getElementById("arrows");
  const trails = document.getElementById("trails");
  const context = canvas.getContext("2d");
  const frames = data.t.length - 1, periods = data.before.length, total = frames * periods;
  const box = data.window;
  let scale, width, height, unit, left, low, colours;
  const px = x => left + unit * (x - box[0]), py = y => height - low - unit * (y - box[2]);
  const red = "#d55e00";
  let position = 0, playing = !window.matchMedia("(prefers-reduced-motion: reduce)").matches, before = null;

  // the size and the colours that the page gives it now
  function fit() {
    scale = Math.max(1, Math.min(3, window.devicePixelRatio || 1));
    width = canvas.clientWidth;
    height = canvas.clientHeight;
    canvas.width = width * scale;
    canvas.height = height * scale;
    unit = Math.min(width / (box[1] - box[0]), height / (box[3] - box[2]));
    left = (width - unit * (box[1] - box[0])) / 2;
    low = (height - unit * (box[3] - box[2])) / 2;
    const style = window.getComputedStyle(document.documentElement), named = name => style.getPropertyValue("--" + name).trim();
    colours = { ink: named("ink"), paper: named("paper"), soft: named("soft"), line: named("line") };
    draw();
  }

  const period = frame => Math.min(Math.floor(frame / frames), periods - 1);

  // values between two frames of the period that a frame falls in
  function at(rows, frame) {
    const inside = frame - period(frame) * frames, k = Math.min(Math.floor(inside), frames - 1), part = inside - k;
    return rows.map(row => (1 - part) * row[k] + part * row[k + 1]);
  }

  // points [x, y] as the periods before turn and shift them; forces are only turned
  function placed(xRows, yRows, frame, shifted = true) {
    const [c, s, dx, dy] = data.before[period(frame)], x = at(xRows, frame), y = at(yRows, frame), shift = shifted ? [dx, dy] : [0, 0];
    return [x.map((value, k) => c * value - s * y[k] + shift[0]), x.map((value, k) => s * value + c * y[k] + shift[1])];
  }

  function line(x, y, colour, thickness) {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    x.forEach((value, k) => k ? context.lineTo(px(value), py(y[k])) : context.moveTo(px(value), py(y[k])));
    context.stroke();
  }

  function disc(x, y, radius, fill, edge) {
    context.beginPath();
    context.arc(px(x), py(y), radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    if (edge) { context.strokeStyle = edge; context.lineWidth = 1.5; context.stroke(); }
  }

  function arrow(x, y, dx, dy) {
    const length = Math.hypot(dx, dy) * unit;
    if (length < 2) return;
    const a = px(x), b = py(y), c = px(x + dx), d = py(y + dy), head = Math.min(6, 0.5 * length), angle = Math.atan2(d - b, c - a);
    context.strokeStyle = context.fillStyle = red;
    context.lineWidth = 1.4;
    context.beginPath();
    context.moveTo(a, b);
    context.lineTo(c, d);
    context.stroke();
    context.beginPath();
    context.moveTo(c, d);
    context.lineTo(c - head * Math.cos(angle - 0.45), d - head * Math.sin(angle - 0.45));
    context.lineTo(c - head * Math.cos(angle + 0.45), d - head * Math.sin(angle + 0.45));
    context.fill();
  }

  function grid() {
    const step = data.grid;
    context.strokeStyle = colours.line;
    context.globalAlpha = 0.5;
    context.lineWidth = 1;
    context.beginPath();
    for (let x = Math.ceil((box[0] - left / unit) / step) * step; px(x) < width; x += step) { context.moveTo(px(x), 0); context.lineTo(px(x), height); }
    for (let y = Math.ceil((box[2] - low / unit) / step) * step; py(y) > 0; y += step) { context.moveTo(0, py(y)); context.lineTo(width, py(y)); }
    context.stroke();
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = colours.soft;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(14, height - 14);
    context.lineTo(14 + unit * step, height - 14);
    context.stroke();
    context.font = "12px system-ui, sans-serif";
    context.fillText(step + " body length" + (step === 1 ? "" : "s"), 14, height - 20);
  }

  function trail(row, colour, thickness) {
    const count = Math.ceil(position);
    const x = [], y = [];
    for (let f = 0; f <= count; f++) {
      const frame = Math.min(f, position);
      const [[px], [py]] = placed([row[0]], [row[1]], frame);
      x.push(px);
      y.push(py);
    }
    line(x, y, colour, thickness);
  }

  function draw() {
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    context.lineCap = context.lineJoin = "round";
    grid();
    const [x, y] = placed(data.x, data.y, position), last = x.length - 1;
    if (trails.checked) {
      trail([data.x[0], data.y[0]], "#56b4e9", 1);
      trail([data.x[last], data.y[last]], "#e69f00", 1);
      trail(data.centre, red, 1.5);
    }
    line(x, y, colours.ink, data.width * unit || 5);
    for (let k = data.hinges[0]; k < data.hinges[1]; k++) disc(x[k], y[k], 3.2, colours.paper, colours.ink);
    disc(x[last], y[last], 6, colours.ink);
    // feet are squares, wheels and pads bars between their ends; those that slide hollow
    const [first, end] = [0, 1].map((side) => placed(data.feet[0][side], data.feet[1][side], position));
    at(data.holding, position).forEach((holds, k) => {
      const kind = data.footKinds[k], colour = kind === "wheel" ? "#009e73" : red;
      for (const [fill, size, cap] of [[colour, 8, "square"], [colours.paper, 4.4, kind === "foot" ? "square" : "butt"]]) {
        if (holds > 0.5 && fill !== colour) continue;
        context.lineCap = cap;
        line([first[0][k], end[0][k] + 1e-6], [first[1][k], end[1][k]], fill, size);
      }
      context.lineCap = "round";
    });
    const [[centreX], [centreY]] = placed([data.centre[0]], [data.centre[1]], position);
    disc(centreX, centreY, 3.5, red);
    if (arrows.checked) {
      const [ax, ay] = placed(data.arrowX, data.arrowY, position), [fx, fy] = placed(data.forceX, data.forceY, position, false);
      ax.forEach((value, k) => arrow(value, ay[k], data.arrowScale * fx[k], data.arrowScale * fy[k]));
    }
    const phase = position / frames % 1;
    shown.textContent = "t = " + (position / frames).toFixed(3);
    slider.value = Math.round(1000 * position / total);
    document.querySelectorAll(".cursor").forEach(mark => {
      mark.style.left = Number(mark.dataset.low) + phase * (Number(mark.dataset.high) - Number(mark.dataset.low)) + "%";
    });
    const angles = at(data.angles, position);
    document.querySelectorAll(".dot").forEach(mark => {
      // percent of left, right, top and bottom, which show these angles
      const side = mark.dataset.sides.split(",").map(Number), limit = mark.dataset.limits.split(",").map(Number);
      const part = (axis, k) => (angles[Number(axis)] - limit[k]) / (limit[k + 1] - limit[k]);
      mark.style.left = side[0] + part(mark.dataset.first, 0) * (side[1] - side[0]) + "%";
      mark.style.top = side[3] - part(mark.dataset.second, 2) * (side[3] - side[2]) + "%";
    });
  }

  function tick(now) {
    if (!playing) { before = null; return; }
    if (before !== null) position = (position + (now - before) / 1000 * frames * Number(rate.value) / 4) % total;
    before = now;
    draw();
    window.requestAnimationFrame(tick);
  }

  function play(wanted) {
    playing = wanted;
    button.textContent = playing ? "❚❚ pause" : "▶ play";
    if (playing) window.requestAnimationFrame(tick);
  }

  button.addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => { play(false); position = total * Number(slider.value) / 1000; draw(); });
  [arrows, trails].forEach(mark => mark.addEventListener("change", draw));
  document.addEventListener("keydown", event => {
    if (event.target === document.body && event.key === " ") { event.preventDefault(); play(!playing); }
  });
  // page.html#t=1.25 opens at that phase, at rest
  const wanted = /^#t=([0-9.]+)$/.exec(window.location.hash);
  if (wanted) { position = Math.min(Number(wanted[1]) * frames, total); playing = false; }
  window.addEventListener("resize", fit);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", fit);
  fit();
  play(playing);
  document.documentElement.dataset.ready = "yes";
})();
