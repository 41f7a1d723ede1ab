"use strict";
// Slow motion of a chain of straight links: friction on each link in closed form, balanced by Newton steps.

// friction on a link (vs along, vn across at its middle, turning at w), and minus its derivative by these
function friction(vs, vn, w, l, mu, delta) {
  const [mt, mf, mb] = mu, ms = vs > 0 ? mf : mb, a2 = vs * vs + delta * delta, y0 = vn - 0.5 * l * w, y1 = vn + 0.5 * l * w;
  const r0 = Math.hypot(vs, delta, y0), r1 = Math.hypot(vs, delta, y1), S = r0 + r1, R = r0 * r1, q = (w * l / S) ** 2;
  const T = a2 + y0 * y1, Q = T < 0 ? (R - T) / (w * l) ** 2 : a2 / (R + T); // without cancellation
  let h = 0;
  if (q < 0.1) for (let j = 15; j >= 0; j--) h = h * q + 1 / (2 * j + 3);
  else h = (Math.log((1 + Math.sqrt(q)) ** 2 * Q * S * S / (2 * a2)) / (2 * Math.sqrt(q)) - 1) / q;
  const g = 1 + q * h, l3 = l ** 3, b = -vn * w * l3 * Q / (R * S);
  const c = 2 * l3 * a2 * h / S ** 3 + l3 * ((a2 + vn * vn) * Q - 0.5 * a2) / (S * R);
  const y = 2 * vn * l / (S * R), sy = w * l3 / S * (2 * h / (S * S) + (Q - 0.5) / R), a = l * S * Q / R;
  return [
    [-ms * vs * 2 * l * g / S, -mt * 2 * vn * l / S, -mt * w * l3 / S * (0.5 * Q - a2 * h / (S * S))],
    [[ms * (a * delta * delta / a2 + vn * y + w * sy), -ms * vs * y, -ms * vs * sy], [-mt * vs * y, mt * a, mt * b], [-mt * vs * sy, mt * b, mt * c]],
  ];
}

// forces on the tail in its frame, minus their derivative by its velocity z, and the power against friction
function balance(body, q, dq, z, mu, delta) {
  const F = [0, 0, 0], J = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  let phi = 0, w = z[2], x = 0, y = 0, u = z[0], v = z[1], power = 0;
  body.lengths.forEach((l, k) => {
    if (k) { phi += q[k - 1]; w += dq[k - 1]; }
    const c = Math.cos(phi), s = Math.sin(phi), share = body.weights[k] / l, mx = x + 0.5 * l * c, my = y + 0.5 * l * s;
    const at = [c * u + s * v, c * v - s * u + 0.5 * l * w, w], [f, M] = friction(...at, l, mu, delta);
    const B = [[c, s, s * mx - c * my], [-s, c, c * mx + s * my], [0, 0, 1]];
    for (let i = 0; i < 3; i++) {
      power -= share * f[i] * at[i];
      for (let a = 0; a < 3; a++) {
        F[a] += share * B[i][a] * f[i];
        for (let j = 0; j < 3; j++) for (let b = 0; b < 3; b++) J[a][b] += share * B[i][a] * M[i][j] * B[j][b];
      }
    }
    x += l * c; y += l * s; u -= l * w * s; v += l * w * c;
  });
  return { F, J, power, size: Math.hypot(...F) };
}

function solve(A, b) {
  const det = (p, q, r) => p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0]) + p[2] * (q[0] * r[1] - q[1] * r[0]);
  const T = [0, 1, 2].map(j => A.map(row => row[j])), whole = det(...T);
  return [0, 1, 2].map(j => det(...T.map((column, k) => k === j ? b : column)) / whole);
}

// the velocity of the tail at which friction is in balance, sought from z with a smoothing that falls
function balanced(body, q, dq, z, mu, delta) {
  for (const rough of [1, 100, 1e4]) {
    let y = z;
    for (let eps = rough * delta; ; eps = Math.max(delta, eps / 3)) {
      let now = balance(body, q, dq, y, mu, eps);
      for (let k = 0; k < 40 && now.size > 1e-11; k++) {
        const step = solve(now.J, now.F);
        let part = 1, next;
        do {
          next = balance(body, q, dq, y.map((x, i) => x + part * step[i]), mu, eps);
          part /= 2;
        } while (!(next.size < now.size) && part > 1e-4);
        if (!(next.size < now.size)) break;
        y = y.map((x, i) => x + 2 * part * step[i]);
        now = next;
      }
      if (eps === delta) {
        if (now.size < 1e-8) return [y, now.power];
        break;
      }
    }
  }
  return [z, NaN];
}

// a cycle of a wave of joint angles: way of the centre of mass, turn, work, and where the joints are at each step
function crawl(body, gait, mu, delta, steps) {
  const n = body.lengths.length, frames = [];
  const wave = (t, turn) => Array.from({ length: n - 1 }, (_, j) => {
    const psi = 2 * Math.PI * t - gait.lag * (j + 1 - n / 2);
    return turn ? -2 * Math.PI * gait.amplitude * Math.sin(psi) : gait.offset + gait.amplitude * Math.cos(psi);
  });
  let z = [0, 0, 0], theta = 0, x = 0, y = 0, work = 0;
  const place = t => {
    let phi = theta, a = x, b = y, cx = 0, cy = 0;
    const points = [[x, y]], q = wave(t, false);
    body.lengths.forEach((l, k) => {
      if (k) phi += q[k - 1];
      const dx = l * Math.cos(phi), dy = l * Math.sin(phi);
      cx += body.weights[k] * (a + 0.5 * dx); cy += body.weights[k] * (b + 0.5 * dy);
      a += dx; b += dy;
      points.push([a, b]);
    });
    frames.push({ points, centre: [cx, cy] });
  };
  place(0);
  for (let k = 0; k < steps; k++) {
    const t = (k + 0.5) / steps, [found, power] = balanced(body, wave(t, false), wave(t, true), z, mu, delta);
    z = found;
    const middle = theta + 0.5 * z[2] / steps, c = Math.cos(middle), s = Math.sin(middle);
    x += (c * z[0] - s * z[1]) / steps; y += (s * z[0] + c * z[1]) / steps;
    theta += z[2] / steps; work += power / steps;
    place((k + 1) / steps);
  }
  const way = [0, 1].map(i => frames[steps].centre[i] - frames[0].centre[i]);
  return { distance: Math.hypot(...way), way, turn: theta, work, frames };
}

// the page: sliders, numbers and the body as it moves
if (typeof document !== "undefined") (function () {
  const body = JSON.parse(document.getElementById("toy-body").textContent), canvas = document.getElementById("toy");
  const sliders = [...document.querySelectorAll("#toy-sliders input")], said = document.getElementById("toy-said");
  const context = canvas.getContext("2d"), still = window.matchMedia("(prefers-reduced-motion: reduce)").matches, steps = 240;
  let motion, begun = null, box;
  function change() {
    const value = {};
    for (const slider of sliders) {
      value[slider.name] = Number(slider.value);
      slider.nextElementSibling.textContent = Number(Number(slider.value).toPrecision(3)) + (slider.dataset.unit || "");
    }
    const angle = name => value[name] * Math.PI / 180, mu = [value.mu_t, value.mu_f, value.mu_b];
    motion = crawl(body, { amplitude: angle("amplitude"), lag: angle("lag"), offset: angle("offset") }, mu, 1e-3, steps);
    const per = motion.work > 1e-9 ? (motion.distance / motion.work).toFixed(4) : "0";
    said.textContent = Number.isFinite(motion.work)
      ? `${motion.distance.toFixed(4)} body lengths a cycle, work ${motion.work.toFixed(4)}: d/W ${per}; turns by ${(Math.round(1800 * motion.turn / Math.PI) / 10 + 0).toFixed(1)}°`
      : "no balance was found: change a slider a little";
    const points = motion.frames.flatMap(frame => frame.points), side = k => points.map(point => point[k]);
    box = [0, 1].map(k => [Math.min(...side(k)) - 0.05, Math.max(...side(k)) + 0.05]);
    draw(begun === null ? 0 : performance.now());
  }
  function draw(now) {
    if (begun === null) begun = now;
    const frame = motion.frames[still ? 0 : Math.floor((now - begun) / 4000 * steps) % steps], scale = window.devicePixelRatio || 1;
    canvas.width = canvas.clientWidth * scale; canvas.height = canvas.clientHeight * scale;
    const unit = Math.min(...box.map(([a, b], k) => (k ? canvas.height : canvas.width) / (b - a))), middle = box.map(([a, b]) => 0.5 * (a + b));
    const at = ([x, y]) => [0.5 * canvas.width + unit * (x - middle[0]), 0.5 * canvas.height - unit * (y - middle[1])];
    const line = (points, colour, width) => {
      context.strokeStyle = colour; context.lineWidth = width * scale; context.lineCap = context.lineJoin = "round";
      context.beginPath();
      points.forEach(point => context.lineTo(...at(point)));
      context.stroke();
    };
    const ink = window.getComputedStyle(document.documentElement).getPropertyValue("--ink").trim(), head = frame.points.at(-1);
    line(motion.frames.map(each => each.centre), "#d55e00", 1.5);
    line(frame.points, ink, 5);
    line([head, head], ink, 12);
    line([frame.centre, frame.centre], "#d55e00", 7);
  }
  function tick(now) { draw(now); window.requestAnimationFrame(tick); }
  sliders.forEach(slider => slider.addEventListener("input", change));
  change();
  if (!still) window.requestAnimationFrame(tick);
})();
